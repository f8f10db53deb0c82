"""`legato export`: a session, or the arm, as files that other tools open."""

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from legato.cli.chosen import chosen, completed, place_for
from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.store import state_dir_option

if TYPE_CHECKING:
    from legato.records.record import SessionRecord

FORMATS = ("mcap", "parquet", "csv", "urdf")


@command("export")
@click.argument("session", required=False, shell_complete=completed)
@click.option("--format", "form", type=click.Choice(FORMATS), default="mcap", show_default=True)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path),
    help="File, or folder for the tables of parquet and csv; by default named for the session.",
)
@state_dir_option
def export(
    context: Context, session: str | None, form: str, out: Path | None, state_dir: Path | None
) -> None:
    """Write SESSION, by default the latest, for other tools.

    mcap plays in Foxglove and Rerun: pictures, frames, the leg and arm as scene, joints, and every
    event. parquet and csv are three tables for notebooks: trajectory, events, contacts. urdf is the
    arm: that of SESSION where one is named, else that of --config.
    """
    if form == "urdf":
        written = [arm(context, session, out, state_dir)]
        said: dict[str, Any] = {"session": session}
    else:
        record = chosen(context, session, state_dir)
        written = whole(record, form, out)
        said = {"session": record.id}
    context.output.document({**said, "format": form, "files": [str(f) for f in written]})
    for file in written:
        context.output.say(str(file))


def whole(record: "SessionRecord", form: str, out: Path | None) -> list[Path]:
    """Write a session in a format and return the files."""
    from legato.export.mcap import write_mcap
    from legato.export.tables import NeedsLibrary, write_csv, write_parquet
    from legato.records.files import replace_file

    if form == "mcap":
        file = place_for(out or Path(f"{record.id}.mcap"))
        stream = io.BytesIO()
        write_mcap(record, stream)
        replace_file(file, stream.getvalue())
        return [file]
    folder = place_for(out or Path(record.id))
    if folder.exists() and not folder.is_dir():
        raise Failure(f"{folder} is a file", Exit.USAGE, f"{form} is three files: name a folder")
    try:
        return (write_csv if form == "csv" else write_parquet)(record, folder)
    except NeedsLibrary as error:
        hint = "pip install 'legato[parquet]', or use --format csv"
        raise Failure(str(error), Exit.FAILED, hint) from error


def arm(context: Context, session: str | None, out: Path | None, state_dir: Path | None) -> Path:
    """Write the arm as URDF and return the file."""
    from legato.config.build import arm_model
    from legato.config.load import load
    from legato.export.arm import recorded_arm
    from legato.export.urdf import urdf
    from legato.records.files import replace_file

    if session is not None:
        model = recorded_arm(chosen(context, session, state_dir))
    else:
        model = arm_model(load(context.config, need_intrinsics=False).config)
    file = place_for(out or Path("teachmover.urdf"))
    replace_file(file, urdf(model).encode())
    return file
