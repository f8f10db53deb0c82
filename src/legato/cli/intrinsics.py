"""`legato intrinsics`: calibrate the camera once, from ten or more pictures of the leg."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.picture import read_picture

if TYPE_CHECKING:
    from legato.calibration.problem import Problem
    from legato.calibration.views import CalibratedViews
    from legato.config.load import Loaded
    from legato.control.settings import CellSettings

LEAST_MARKS = 7
OUTLYING = 3.0  # times the median view's residual
OUTLYING_PX = 1.0
HINT = "take at least ten sharp pictures with face and side in view, each from another pose"


@command("intrinsics")
@click.argument("images", nargs=-1, required=True, type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--out",
    "file",
    required=True,
    type=click.Path(dir_okay=False, path_type=Path),
    help="The intrinsics file to write; name it in camera.intrinsics.",
)
def intrinsics(context: Context, images: tuple[Path, ...], file: Path) -> None:
    """Calibrate the camera from IMAGES of the leg in ten or more poses, and write --out.

    A picture that cannot be used is named and left out; a file that is not there is an error.
    """
    from legato.config.intrinsics import write_intrinsics
    from legato.config.load import load

    loaded = load(context.config, need_intrinsics=False)
    refuse_missing(images)
    used, left_out = find_views(context, loaded, images)
    result = calibrate(context, loaded, used, left_out)
    if not result.converged or result.rms_px > loaded.config.calibration.max_rms_px:
        limit = loaded.config.calibration.max_rms_px
        text = f"the views fit one camera to {result.rms_px:.2f} px only, {limit:g} px allowed"
        raise Failure(text, Exit.REFUSED, "see that [leg] has this leg's measures and marks")
    created = datetime.now(UTC).isoformat(timespec="seconds")
    write_intrinsics(file, result.known, views=len(used), rms_px=result.rms_px, created=created)
    show(context, result, file, used, left_out)


def refuse_missing(images: Sequence[Path]) -> None:
    """Raise Failure for files that are not there: a slip of the pen, not a bad picture."""
    missing = [str(path) for path in images if not path.exists()]
    if missing:
        text = f"there is no file {', '.join(missing)}"
        raise Failure(text, Exit.USAGE, "see that every picture's name is right")


def find_views(
    context: Context, loaded: "Loaded", images: Sequence[Path]
) -> tuple[dict[Path, "Problem"], dict[Path, str]]:
    """Return each usable picture's marks, and why the others are left out."""
    from legato.config.build import cell_settings
    from legato.vision.marks import MarksNotFound
    from legato.vision.picture import PictureError

    settings = cell_settings(loaded)
    used: dict[Path, Problem] = {}
    left_out: dict[Path, str] = {}
    for path in dict.fromkeys(images):
        try:
            view = view_of(loaded, settings, path)
        except (MarksNotFound, PictureError, Failure, OSError) as error:
            left_out[path] = str(error)
        else:
            if len(view.names) < LEAST_MARKS:
                left_out[path] = f"only {len(view.names)} marks found, {LEAST_MARKS} needed"
            else:
                used[path] = view
        found = f"{len(used[path].names)} marks" if path in used else left_out[path]
        context.output.note(f"{path}: {found}")
    return used, left_out


def view_of(loaded: "Loaded", settings: "CellSettings", path: Path) -> "Problem":
    """Return the marks of one picture as a calibration problem without known intrinsics."""
    import numpy as np

    from legato.calibration.problem import GENES, Problem
    from legato.vision.pick import find_marks

    camera, table = loaded.config.camera, loaded.config.calibration
    picture = read_picture(path, camera)
    picking = find_marks(picture, settings.leg, settings.nominal, seed=table.seed)
    names = tuple(picking.marks)
    marks = [picking.marks[n] for n in names]
    return Problem(
        names=names,
        points=settings.leg.points(names).reshape(-1, 3),
        pixels=np.array([(m.u, m.v) for m in marks]).reshape(-1, 2),
        sigma=np.maximum([m.sigma for m in marks], table.pixel_sigma),
        bounds={gene: getattr(table.bounds, gene) for gene in GENES},
        size=(camera.width, camera.height),
    )


def calibrate(
    context: Context, loaded: "Loaded", used: dict[Path, "Problem"], left_out: dict[Path, str]
) -> "CalibratedViews":
    """Return the intrinsics; views that do not fit the others leave `used` for `left_out`."""
    import numpy as np

    from legato.calibration.problem import CalibrationError
    from legato.calibration.views import calibrate_views
    from legato.config.build import engine_settings

    rng = np.random.default_rng(loaded.config.calibration.seed)
    while True:
        try:
            result = calibrate_views(list(used.values()), engine_settings(loaded.config), rng)
        except CalibrationError as error:
            raise Failure(error.text, Exit.REFUSED, error.hint or HINT) from error
        limit = max(OUTLYING_PX, OUTLYING * float(np.median(result.view_rms_px)))
        wrong = [p for p, rms in zip(used, result.view_rms_px, strict=True) if rms > limit]
        if not wrong:
            return result
        for path in wrong:
            del used[path]
            left_out[path] = "does not fit the camera that the other pictures show"
            context.output.note(f"{path}: {left_out[path]}")


def show(
    context: Context,
    result: "CalibratedViews",
    file: Path,
    used: dict[Path, "Problem"],
    left_out: dict[Path, str],
) -> None:
    """Show what was found, with its error, and which pictures took part."""
    import numpy as np

    out, found = context.output, result.known.intrinsics
    names = ("alpha_u", "alpha_v", "u0", "v0", "k1", "k2")
    sigma = np.sqrt(np.diag(result.known.covariance))
    values = {name: float(getattr(found, name)) for name in names}
    out.document(
        {
            **values,
            "sigma": dict(zip(names, sigma.tolist(), strict=True)),
            "rms_px": result.rms_px,
            "views": len(used),
            "used": [str(p) for p in used],
            "left_out": {str(p): why for p, why in left_out.items()},
            "file": str(file),
        }
    )
    rows = [(name, f"{values[name]:.4f}", f"{s:.4f}") for name, s in zip(names, sigma, strict=True)]
    out.table(("", "value", "sigma"), rows)
    out.say(f"{len(used)} views, {result.rms_px:.3f} px rms: {file}")
