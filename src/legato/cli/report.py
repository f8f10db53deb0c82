"""`legato report`: a session's record as one page, or set for paper."""

from pathlib import Path

import click

from legato.cli.chosen import chosen, completed, place_for
from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.store import state_dir_option


@command("report")
@click.argument("session", required=False, shell_complete=completed)
@click.option("--pdf", is_flag=True, help="As PDF, set for paper; needs legato[pdf].")
@click.option(
    "-o",
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    help="The file; by default report.html or report.pdf in the session's folder.",
)
@state_dir_option
def report(
    context: Context, session: str | None, pdf: bool, out: Path | None, state_dir: Path | None
) -> None:
    """Write the report of SESSION, by default the latest, and print its path."""
    from legato.report.html import write_report
    from legato.report.pdf import NeedsTypst, write_pdf

    target = None if out is None else place_for(out)
    record = chosen(context, session, state_dir)
    try:
        path = (write_pdf if pdf else write_report)(record, target)
    except NeedsTypst as error:
        hint = "pip install 'legato[pdf]', or leave --pdf out and print the page"
        raise Failure(str(error), Exit.FAILED, hint) from error
    context.output.document({"session": record.id, "report": str(path)})
    context.output.say(str(path))
