"""`legato solve`: from one picture to the leg's pose, and whether it may be trusted."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.picture import read_picks, read_picture

if TYPE_CHECKING:
    from legato.control.settings import CellSettings

ENGINES = ("hybrid", "paper", "separable")


@command("solve")
@click.argument("image", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--engine", type=click.Choice(ENGINES), help="Default: calibration.engine.")
@click.option("--marks", metavar="P1,P2,...", help="Use only these marks.")
@click.option(
    "--picks",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Marks picked by a person: JSON or TOML with P1 = [u, v], or CSV lines of name,u,v.",
)
def solve(
    context: Context, image: Path, engine: str | None, marks: str | None, picks: Path | None
) -> None:
    """Find the leg in IMAGE and print its pose; exit 3 where it may not be trusted."""
    from legato.calibration.problem import CalibrationError
    from legato.config.load import load
    from legato.control.document import document
    from legato.control.perceive import find_leg
    from legato.control.verify import picture_checks
    from legato.vision.marks import MarksNotFound

    loaded = load(context.config)
    settings = chosen(loaded, engine, marks)
    picture = read_picture(image, loaded.config.camera)
    picked = read_picks(picks, settings.leg.names()) if picks is not None else None
    began = time.perf_counter()
    try:
        found = find_leg(picture, settings, seed=settings.calibration.seed, picks=picked)
    except (MarksNotFound, CalibrationError) as error:
        refuse(context, settings, error.text, error.hint, time.perf_counter() - began)
    checks = picture_checks(found, settings)
    result = document(found, settings, checks) | {"seconds": time.perf_counter() - began}
    context.output.document(result)
    show(context, result)
    if not all(check.ok for check in checks):
        context.end(Exit.REFUSED)


def chosen(loaded: Any, engine: str | None, marks: str | None) -> "CellSettings":
    """Return the cell's settings with the engine and marks that were asked for."""
    from dataclasses import replace

    from msgspec import structs

    from legato.config.build import cell_settings

    settings = cell_settings(loaded)
    table = settings.calibration
    if engine is not None:
        table = structs.replace(table, engine=engine)
    if marks is not None:
        names = tuple(name.strip() for name in marks.split(",") if name.strip())
        wrong = [n for n in names if n not in settings.leg.marks]
        if wrong or not names or len(set(names)) < len(names):
            known = ", ".join(settings.leg.marks)
            what = f"the leg has no mark {', '.join(wrong)}" if wrong else "name each mark once"
            what = what if names else "it names no mark"
            raise Failure(f"--marks {marks!r}: {what}", Exit.USAGE, f"the leg's marks are {known}")
        table = structs.replace(table, marks=names)
    return replace(settings, calibration=table)


def refuse(
    context: Context, settings: "CellSettings", text: str, hint: str, seconds: float
) -> NoReturn:
    """Say why there is no pose at all, and end as refused."""
    engine = settings.calibration.engine
    context.output.document(
        {"accepted": False, "reasons": [text], "hint": hint, "engine": engine, "seconds": seconds}
    )
    context.output.note(f"not accepted: {text}" + (f"\n  what to do: {hint}" if hint else ""))
    context.end(Exit.REFUSED)


def show(context: Context, result: dict[str, Any]) -> None:
    """Show a person the checks, the pose's error and where the stations are."""
    out, sigma = context.output, result["sigma"]
    rows = [(c["name"], "ok" if c["ok"] else "NO", c["text"]) for c in result["checks"]]
    out.table(("check", "", "what was found"), rows)
    for check in result["checks"]:
        if not check["ok"]:
            out.say(f"  {check['name']}: what to do: {check['hint']}")
    places = [
        (s["station_mm"], *(f"{v:.2f}" for v in s["place_mm"]), s["sigma_mm"])
        for s in result["stations"]
    ]
    out.table(("station mm", "x mm", "y mm", "z mm", "sigma mm"), places)
    out.say(
        f"{'accepted' if result['accepted'] else 'not accepted'}: {result['engine']}, "
        f"{len(result['marks'])} marks, {result['rms_px']:.3f} px rms, pose to "
        f"{sigma['rotation_deg']:.3f} deg and {sigma['translation_mm']:.3f} mm, "
        f"{result['seconds']:.2f} s"
    )
    for warning in result["warnings"]:
        out.note(f"note: {warning}")
