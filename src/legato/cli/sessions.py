"""`legato sessions`: what was recorded, read from disk; no daemon is needed."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from legato.cli.chosen import completed
from legato.cli.command import Context, command
from legato.cli.examples import write_examples
from legato.cli.exits import EPILOG
from legato.cli.records import replay, verify
from legato.cli.store import opened_store, state_dir_option
from legato.report.clock import day
from legato.report.devices import REAL, SIMULATED, cell

if TYPE_CHECKING:
    from legato.records.record import SessionRecord
    from legato.records.store import Store, Summary


class Sessions(click.Group):
    """A group whose first command is meant where none is named: `legato sessions ID`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Bring the command's name to the front, or put the one that is meant there."""
        named = [word for word in args if word in self.commands]
        if named:
            args = [named[0], *(args[: args.index(named[0])] + args[args.index(named[0]) + 1 :])]
        elif "--help" not in args:
            args = ["show", *args]
        return super().parse_args(ctx, args)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples, then what every command ends with."""
        write_examples(ctx, formatter)
        super().format_epilog(ctx, formatter)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Show the options of the command that is meant where none is named."""
        show = self.commands["show"]
        show.format_options(click.Context(show, parent=ctx), formatter)
        self.format_commands(ctx, formatter)


@click.group("sessions", cls=Sessions, epilog=EPILOG, subcommand_metavar="[COMMAND] [ID]...")
def sessions() -> None:
    """List the recorded sessions, show one, verify its record, or replay it.

    `legato sessions` lists, `legato sessions ID` shows one.
    """


def completed_first(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
    """Return the commands and ids that begin so: a shell asks `show`, which is meant by none."""
    group = ctx.parent.command if ctx.parent is not None else None
    names = [*group.commands] if isinstance(group, Sessions) else []
    named = [name for name in names if name.startswith(incomplete)]
    return named + completed(ctx, param, incomplete)


@command("show")
@click.argument("session", required=False, shell_complete=completed_first)
@state_dir_option
@click.option("--limit", type=click.IntRange(min=1), default=20, show_default=True)
def listed(context: Context, session: str | None, state_dir: Path | None, limit: int) -> None:
    """List the latest sessions, newest first, or show one by its SESSION id."""
    store, out = opened_store(context, state_dir), context.output
    if session is not None:
        show(context, store.read(session))
        return
    found = store.sessions()[:limit]
    keys = ("id", "job", "started", "ended", "outcome", "reason", "cause", "simulated")
    out.document([{key: getattr(s, key) for key in keys} for s in found])
    if out.as_json:
        return  # a list that is as long again, for nobody
    rows = [
        (s.id, day(s.started) or s.started, s.job, s.outcome or "open", kind(store, s),
         s.reason or "")
        for s in found
    ]  # fmt: skip
    if rows:
        out.table(("session", "began", "job", "outcome", "cell", "reason"), rows)
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
    times = {key: day(head[key]) for key in ("started", "ended")}
    rows = [(key, times.get(key) or value) for key, value in head.items() if value is not None]
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


def kind(store: "Store", session: "Summary") -> str:
    """Return what kind of cell a session was of, which its session.json says in full."""
    from legato.records.chain import SESSION
    from legato.records.errors import RecordError
    from legato.records.files import read_object

    if not session.simulated:
        return REAL
    try:
        return cell(read_object(store.folder / session.id / SESSION))
    except (FileNotFoundError, RecordError):
        return SIMULATED


for item in (listed, verify, replay):
    sessions.add_command(item)
