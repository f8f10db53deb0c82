"""`legato report`: a session's record as one page."""

from pathlib import Path

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.sessions import opened_store, state_dir_option


@command("report")
@click.argument("session", required=False)
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    help="The page's file; by default report.html in the session's folder.",
)
@state_dir_option
def report(context: Context, session: str | None, out: Path | None, state_dir: Path | None) -> None:
    """Write the report of SESSION, by default the latest, and print its path."""
    from legato.report.html import write_report

    if out is not None and not out.absolute().parent.is_dir():
        hint = "make it first, or name a file in another folder"
        raise Failure(f"{out}: there is no folder {out.parent}", Exit.USAGE, hint)
    store = opened_store(context, state_dir)
    if session is None:
        found = store.sessions()
        if not found:
            hint = "make one with `legato demo`"
            raise Failure(f"there is no session in {store.folder}", Exit.FAILED, hint)
        session = found[0].id
    record = store.read(session)
    path = write_report(record, out if out is not None else record.path / "report.html")
    context.output.document({"session": session, "report": str(path)})
    context.output.say(str(path))
