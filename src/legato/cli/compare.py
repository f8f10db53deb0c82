"""`legato compare`: sessions side by side, as a page and as tables."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from legato.cli.chosen import completed, place_for
from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.store import opened_store, state_dir_option

MOST = 20  # differences shown here

if TYPE_CHECKING:
    from legato.records.store import Store
    from legato.report.compare import Comparison


@command("compare")
@click.argument("sessions", nargs=-1, shell_complete=completed)
@click.option("--last", type=click.IntRange(min=2), help="The latest so many, instead of names.")
@click.option("--job", help="With --last: only sessions of this job.")
@click.option(
    "-o",
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    default=Path("compare.html"),
    show_default=True,
    help="The page's file.",
)
@state_dir_option
def compare(
    context: Context,
    sessions: tuple[str, ...],
    last: int | None,
    job: str | None,
    out: Path,
    state_dir: Path | None,
) -> None:
    """Put SESSIONS side by side: how they ended, how well they repeat, what was different.

    Writes a page with plots, and shows its tables here.
    """
    from legato.report.campaign import write_comparison

    store, target = opened_store(context, state_dir), place_for(out)
    names = chosen_names(store, sessions, last, job)
    found = write_comparison([store.read(name) for name in names], target)
    context.output.document({**found.as_json(), "report": str(target)})
    show(context, found)
    context.output.say(str(target))


def chosen_names(
    store: "Store", sessions: tuple[str, ...], last: int | None, job: str | None
) -> list[str]:
    """Return the sessions to compare, oldest first where they are not named."""
    if sessions and last is not None:
        raise click.UsageError("name sessions, or give --last, not both")
    if job is not None and last is None:
        raise click.UsageError("--job goes with --last")
    names = list(sessions)
    if last is not None:
        names = [s.id for s in store.sessions() if job in (None, s.job)][:last][::-1]
    if len(names) < 2:
        hint = "name two or more, or give --last N; `legato sessions` lists them"
        raise Failure("there is nothing to compare", Exit.USAGE, hint)
    return names


def show(context: Context, found: "Comparison") -> None:
    """Show sessions, stations and differences to a person."""
    out = context.output
    if found.mixed:
        out.say("simulated and real sessions stand side by side: their figures differ in meaning")
    out.table(
        ("no.", "session", "job", "outcome", "cell", "wall s", "rms px", "1 sigma mm", "true mm"),
        [
            (s.number, s.id, s.job, s.outcome, s.cell,
             s.seconds, s.rms_px, s.sigma_mm, s.error_mm)
            for s in found.sides
        ],
    )  # fmt: skip
    if found.stations:
        out.say("")
        out.table(
            ("station mm", "mean mm", "between sessions sd mm", "within sd mm", "range mm"),
            [(f"{t.station_mm:g}", t.mean, t.between, t.within, t.span) for t in found.stations],
        )
    if found.pose_sd_mm is not None and found.pose_sd_deg is not None:
        shift, turn = (
            ", ".join(f"{v:.3g}" for v in sd) for sd in (found.pose_sd_mm, found.pose_sd_deg)
        )
        out.say("")
        out.say(f"leg found, sd: {shift} mm along x y z, {turn} deg about them")
    if found.differences:
        out.say("")
        out.table(("different", "value, sessions"),
                  [(d.key, d.told()) for d in found.differences[:MOST]])  # fmt: skip
        if len(found.differences) > MOST:
            out.say(f"and {len(found.differences) - MOST} more: the page has them all")
