"""`legato intrinsics`: calibrate the camera once, from ten or more pictures of the leg."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.numbers import Number
from legato.cli.picture import read_picture

if TYPE_CHECKING:
    from legato.calibration.problem import Problem
    from legato.calibration.views import CalibratedViews
    from legato.config.load import Loaded
    from legato.control.settings import CellSettings

LEAST_MARKS = 7
OUTLYING = 3.0  # times the median view's residual
OUTLYING_PX = 0.1
DOUBTED_PX = 0.1
MOST_MARK_SIGMA = 5.0  # mm; beyond it a mark has no place at all
MISFIT_HINT = (
    "see that [leg] has this leg's measures and marks; for marks pasted on by hand "
    "give --mark-sigma, such as 0.3"
)
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
@click.option(
    "--mark-sigma",
    type=Number(0.0, MOST_MARK_SIGMA),
    default=0.0,
    metavar="MM",
    help="How exactly the marks were pasted on: their places are estimated too, about [leg.marks].",
)
def intrinsics(context: Context, images: tuple[Path, ...], file: Path, mark_sigma: float) -> None:
    """Calibrate the camera from IMAGES of the leg in ten or more poses, and write --out.

    A picture that cannot be used is named and left out; a file that is not there is an error.
    """
    from legato.config.intrinsics import write_intrinsics
    from legato.config.load import load

    loaded = load(context.config, need_intrinsics=False)
    refuse_slips(images, file)
    used, left_out = find_views(context, loaded, images)
    result = calibrate(context, loaded, used, left_out, mark_sigma)
    if not result.converged or result.rms_px > loaded.config.calibration.max_rms_px:
        limit = loaded.config.calibration.max_rms_px
        text = f"the views fit one camera to {result.rms_px:.2f} px only, {limit:g} px allowed"
        raise Failure(text, Exit.REFUSED, MISFIT_HINT)
    write_intrinsics(
        file,
        result.known,
        views=len(used),
        rms_px=result.rms_px,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        view_rms_px=result.view_rms_px.tolist(),
        mark_rms_px=mark_residuals(result, list(used.values())),
        marks={n: p.tolist() for n, p in result.marks.items()} if mark_sigma > 0.0 else None,
    )
    show(context, result, file, used, left_out)
    doubt(context, mark_residuals(result, list(used.values())))
    if mark_sigma > 0.0:
        show_marks(context, result, dict(loaded.config.leg.marks))


def refuse_slips(images: Sequence[Path], file: Path) -> None:
    """Raise Failure, before anything is computed, for what is a slip of the pen."""
    missing = [str(path) for path in images if not path.exists()]
    if missing:
        text = f"there is no file {', '.join(missing)}"
        raise Failure(text, Exit.USAGE, "see that every picture's name is right")
    if not file.absolute().parent.is_dir():
        raise Failure(f"--out {file}: there is no folder {file.parent}", Exit.USAGE)
    if file.absolute() in {path.absolute() for path in images}:
        raise Failure(f"--out {file} is one of the pictures", Exit.USAGE, "name another file")


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
    context: Context,
    loaded: "Loaded",
    used: dict[Path, "Problem"],
    left_out: dict[Path, str],
    mark_sigma: float,
) -> "CalibratedViews":
    """Return the intrinsics; views that misfit or repeat others leave `used` for `left_out`."""
    import numpy as np

    from legato.calibration.problem import CalibrationError
    from legato.calibration.views import calibrate_views, repeats
    from legato.config.build import engine_settings

    rng = np.random.default_rng(loaded.config.calibration.seed)
    settings = engine_settings(loaded.config)
    while True:
        try:
            result = calibrate_views(list(used.values()), settings, rng, mark_sigma)
        except CalibrationError as error:
            raise Failure(error.text, Exit.REFUSED, error.hint or HINT) from error
        limit = max(OUTLYING_PX, OUTLYING * float(np.median(result.view_rms_px)))
        paths, misfit = list(used), "does not fit the camera that the other pictures show"
        same = repeats(result.poses)
        wrong = {paths[i]: f"shows the leg just as {paths[k]} does" for i, k in same.items()}
        wrong |= {p: misfit for p, r in zip(paths, result.view_rms_px, strict=True) if r > limit}
        if not wrong:
            return result
        for path, why in wrong.items():
            del used[path]
            left_out[path] = why
            context.output.note(f"{path}: {left_out[path]}")


def mark_residuals(result: "CalibratedViews", views: Sequence["Problem"]) -> dict[str, float]:
    """Return each mark's residual, px rms over u and v of all views."""
    import numpy as np

    squares: dict[str, list[float]] = {}
    for view, off in zip(views, result.residuals, strict=True):
        for name, pair in zip(view.names, off, strict=True):
            squares.setdefault(name, []).extend((pair**2).tolist())
    return {n: float(np.sqrt(np.mean(s))) for n, s in sorted(squares.items(), key=by_number)}


def doubt(context: Context, residuals: Mapping[str, float]) -> None:
    """Name the marks that fit much worse than the others: one of them may be misplaced."""
    import numpy as np

    limit = max(DOUBTED_PX, OUTLYING * float(np.median(list(residuals.values()))))
    for name, rms in residuals.items():
        if rms > limit:
            context.output.note(f"{name} fits to {rms:.2f} px only: is it where [leg.marks] says?")


def by_number(item: tuple[str, object]) -> tuple[int, str]:
    """Return a key that puts P10 after P9."""
    return len(item[0]), item[0]


def show_marks(
    context: Context, result: "CalibratedViews", given: Mapping[str, Sequence[float]]
) -> None:
    """Show where the marks are, and how far that is from where [leg.marks] has them."""
    import numpy as np

    rows = [
        (n, *(f"{x:.3f}" for x in place), f"{float(np.linalg.norm(place - given[n])):.3f}")
        for n, place in sorted(result.marks.items(), key=by_number)
    ]
    context.output.table(("mark", "x mm", "y mm", "z mm", "moved mm"), rows)
    context.output.note("to use these places put the file's [marks] into [leg.marks]")


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
            "view_rms_px": result.view_rms_px.tolist(),
            "mark_rms_px": mark_residuals(result, list(used.values())),
            "marks": {n: p.tolist() for n, p in sorted(result.marks.items(), key=by_number)},
            "used": [str(p) for p in used],
            "left_out": {str(p): why for p, why in left_out.items()},
            "file": str(file),
        }
    )
    rows = [(name, f"{values[name]:.4f}", f"{s:.4f}") for name, s in zip(names, sigma, strict=True)]
    out.table(("", "value", "sigma"), rows)
    out.say(f"{len(used)} views, {result.rms_px:.3f} px rms: {file}")
