"""`legato solve`: from one picture to the leg's pose, and whether it may be trusted."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.picture import picks_option, read_picks, read_picture

if TYPE_CHECKING:
    from legato.calibration.problem import CalibrationError
    from legato.control.settings import CellSettings
    from legato.vision.marks import MarksNotFound, Picking

ENGINES = ("hybrid", "paper", "separable")


@command("solve")
@click.argument("image", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--engine", type=click.Choice(ENGINES), help="Default: calibration.engine.")
@click.option("--marks", metavar="P1,P2,...", help="Use only these marks.")
@picks_option
def solve(
    context: Context, image: Path, engine: str | None, marks: str | None, picks: Path | None
) -> None:
    """Find the leg in IMAGE and print its pose; exit 3 where it may not be trusted."""
    from legato.calibration.problem import CalibrationError
    from legato.config.load import load
    from legato.control.checks import picture_checks
    from legato.control.document import document
    from legato.control.perceive import pick_marks, refuse_outdated, solve_marks
    from legato.vision.marks import MarksNotFound

    loaded = load(context.config)
    settings = chosen(loaded, engine, marks)
    picture = read_picture(image, loaded.config.camera)
    picked = read_picks(picks, settings.leg.names()) if picks is not None else None
    began = time.perf_counter()
    seed, picking = settings.calibration.seed, None
    try:
        refuse_outdated(settings, time.time())
        picking = pick_marks(picture, settings, seed=seed, picks=picked)
        found = solve_marks(picking, settings, seed=seed)
    except (MarksNotFound, CalibrationError) as error:
        refuse(context, settings, error, picking, time.perf_counter() - began)
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
    context: Context,
    settings: "CellSettings",
    error: "MarksNotFound | CalibrationError",
    picking: "Picking | None",
    seconds: float,
) -> NoReturn:
    """Say why there is no pose at all and which marks would help, and end as refused."""
    from legato.control.advice import Advice, advise_marks
    from legato.control.document import suggestion

    missing = dict(picking.missing) if picking is not None else {}
    unseen = Advice((), settings.leg.names())
    advice = advise_marks(picking, settings) if picking is not None else unseen
    context.output.document(
        {
            "accepted": False,
            "reasons": [error.text],
            "hint": error.hint,
            "engine": settings.calibration.engine,
            "missing": missing,
            "suggest": suggestion(advice),
            "seconds": seconds,
        }
    )
    for name, reason in missing.items():
        context.output.note(f"{name} is missing: {reason}")
    hint = error.hint or (f"show {' or '.join(advice.add)} too" if advice.add else "")
    context.output.note(f"not accepted: {error.text}" + (f"\n  what to do: {hint}" if hint else ""))
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
    left, marks = result["left_out"], f"{len(result['marks'])} marks"
    if left:
        marks = f"{len(result['marks']) - len(left)} marks, without {' and '.join(left)}"
    verdict = "accepted" if result["accepted"] else "not accepted"
    out.say(
        f"{verdict}: {result['engine']}, {marks}, {result['rms_px']:.3f} px rms, pose to "
        f"{sigma['rotation_deg']:.3f} deg and {sigma['translation_mm']:.3f} mm, "
        f"{result['seconds']:.2f} s"
    )
    if result["suggest"]["why"]:
        out.note(f"note: {result['suggest']['why']}")
    for warning in result["warnings"]:
        out.note(f"note: {warning}")
