"""`legato detect`: the marks in one picture."""

from pathlib import Path

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit
from legato.cli.picture import read_picture


@command("detect")
@click.argument("image", type=click.Path(dir_okay=False, path_type=Path))
def detect(context: Context, image: Path) -> None:
    """Find the leg's marks in IMAGE and print their places in px."""
    from legato.config.build import cell_settings
    from legato.config.load import load
    from legato.control.advice import advise_marks
    from legato.control.document import suggestion
    from legato.vision.marks import MarksNotFound
    from legato.vision.pick import find_marks

    loaded = load(context.config, need_intrinsics=False)
    settings, out = cell_settings(loaded), context.output
    picture = read_picture(image, loaded.config.camera)
    try:
        seed = loaded.config.calibration.seed
        picking = find_marks(picture, settings.leg, settings.nominal, seed=seed)
    except MarksNotFound as error:
        names = list(settings.leg.names())
        reasons = {"reason": error.text, "hint": error.hint, "candidates": error.candidates}
        out.document({"marks": {}, "missing": names, **reasons})
        out.note(f"legato: {error.text}\n  what to do: {error.hint}")
        context.end(Exit.FAILED)
    marks = {name: [m.u, m.v] for name, m in picking.marks.items()}
    reasons = dict(picking.missing)
    advice = advise_marks(picking, settings)
    told = {"marks": marks, "missing": list(reasons), "reasons": reasons}
    out.document(told | {"suggest": suggestion(advice)})
    rows = [(name, m.u, m.v, m.sigma) for name, m in picking.marks.items()]
    out.table(("mark", "u px", "v px", "sigma px"), rows)
    for name, reason in reasons.items():
        out.note(f"{name} is missing: {reason}")
    if advice.why:
        out.note(f"note: {advice.why}")
