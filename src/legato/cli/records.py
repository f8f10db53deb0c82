"""`legato sessions verify` and `replay`: whether a record is as it was written, and as decided."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from legato.cli.chosen import completed
from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.store import opened_store, state_dir_option

if TYPE_CHECKING:
    from legato.records.store import Store
    from legato.records.whole import RecordReport
    from legato.replay.replay import Replay


@command("verify")
@click.argument("ids", nargs=-1, metavar="[ID]...", shell_complete=completed)
@state_dir_option
def verify(context: Context, ids: tuple[str, ...], state_dir: Path | None) -> None:
    """Hold records to their hashes: those with these IDs, or all of them.

    The first line of events.jsonl that is changed, missing or out of order is named, and every
    file that is changed, missing or was added. Ends with 1 where anything is.
    """
    from legato.records.whole import verify_record

    store, out = opened_store(context, state_dir), context.output
    wanted = [store.read(name).id for name in ids] or [s.id for s in store.sessions()[::-1]]
    reports = [verify_record(store.folder / name) for name in wanted]
    out.document([asdict(report) for report in reports])
    for report in reports:
        _say_verified(context, report)
    if not reports:
        out.say(f"no sessions in {store.folder}")
    broken = sum(not report.ok for report in reports)
    if broken:
        out.say(f"{broken} of {len(reports)} records are not as they were written")
        context.end(Exit.FAILED)


def _say_verified(context: Context, report: "RecordReport") -> None:
    lines = f", {report.chain.lines} lines" if report.chain is not None else ""
    context.output.say(f"{report.id}: {'sound' if report.ok else 'BROKEN'}{lines}")
    for text in (*report.findings, *report.notes):
        context.output.say(f"  {text}")


@command("replay")
@click.argument("id_", metavar="[ID]", required=False, shell_complete=completed)
@state_dir_option
def replay(context: Context, id_: str | None, state_dir: Path | None) -> None:
    """Let the record of session ID, or the latest, drive its job again; compare every decision.

    Its configuration, pictures, registers and contacts are fed back; nothing moves. The first
    difference is named, and ends with 1.
    """
    from legato.replay.replay import replay as run

    store = opened_store(context, state_dir)
    found = run(store.read(id_ if id_ is not None else _latest(store)))
    context.output.document(asdict(found))
    _say_replayed(context, found)
    if not found.same:
        context.end(Exit.FAILED)


def _latest(store: "Store") -> str:
    latest = next((s.id for s in store.sessions() if s.outcome is not None), None)
    if latest is None:
        raise Failure(f"no session in {store.folder} has ended")
    return latest


def _say_replayed(context: Context, found: "Replay") -> None:
    out = context.output
    if found.same:
        out.say(f"{found.id}: the same decisions again, {found.effects} effects, {found.end}")
    else:
        out.say(f"{found.id}: differs at {found.where}")
        out.say(f"  recorded: {found.recorded}")
        out.say(f"  replayed: {found.replayed}")
    for note in found.notes:
        out.say(f"  {note}")
