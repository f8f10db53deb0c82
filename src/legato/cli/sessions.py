"""`legato sessions`: what was recorded, read from disk; no daemon is needed."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from legato.cli.command import Context, command

if TYPE_CHECKING:
    from legato.records.record import SessionRecord
    from legato.records.store import Store

state_dir_option = click.option(
    "--state-dir",
    type=click.Path(file_okay=False, path_type=Path),
    help="Where the records are; by default records.state_dir.",
)


def opened_store(context: Context, state_dir: Path | None) -> "Store":
    """Return the store of records under `state_dir`, or where the configuration says."""
    from legato.config.load import load
    from legato.records.store import Store

    if state_dir is not None:
        return Store(state_dir)
    return Store(Path(load(context.config, need_intrinsics=False).config.records.state_dir))


@command("sessions")
@click.argument("session", required=False)
@state_dir_option
@click.option("--limit", type=click.IntRange(min=1), default=20, show_default=True)
def sessions(context: Context, session: str | None, state_dir: Path | None, limit: int) -> None:
    """List the latest sessions, newest first, or show one by its SESSION id."""
    store, out = opened_store(context, state_dir), context.output
    if session is not None:
        show(context, store.read(session))
        return
    found = store.sessions()[:limit]
    keys = ("id", "job", "started", "ended", "outcome", "reason", "cause", "simulated")
    out.document([{key: getattr(s, key) for key in keys} for s in found])
    rows = [(s.id, s.job, s.outcome or "open", _kind(s.simulated), s.reason or "") for s in found]
    if rows:
        out.table(("session", "job", "outcome", "cell", "reason"), rows)
    else:
        out.say(f"no sessions in {store.folder}")


def show(context: Context, record: "SessionRecord") -> None:
    """Show one session: what was asked, how it ended, its states and contacts."""
    out, meta = context.output, record.meta
    states = states_of(record)
    contacts = [dict(e["data"]) for e in record.of_kind("contact")]
    keys = ("id", "job", "started", "ended", "outcome", "reason", "cause", "simulated")
    head = {key: meta.get(key) for key in keys}
    places = {"path": str(record.path), "torn": record.torn, "events": len(record.events)}
    out.document({**head, **places, "states": states, "contacts": contacts})
    rows = [(key, value) for key, value in head.items() if value is not None]
    out.table(("", ""), [*rows, ("states", " ".join(states)), ("record", str(record.path))])
    if record.torn:
        out.say("the record is torn: what was written last is missing")
    if contacts:
        columns = ("station_mm", "stroke", "contact_mm", "place_mm", "across_mm")
        out.table(columns, [[c.get(key) for key in columns] for c in contacts])


def states_of(record: "SessionRecord") -> list[str]:
    """Return the states that a session went through, in order."""
    found: list[Any] = [e["data"].get("state") for e in record.of_kind("state")]
    return [str(s) for s in found]


def _kind(simulated: bool) -> str:
    return "simulated" if simulated else "real"
