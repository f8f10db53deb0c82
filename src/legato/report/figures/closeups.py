"""Each mark enlarged, with where it was found and where the pose predicts it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from legato.geometry.transforms import Array
from legato.report.figures.canvas import (
    BLUE,
    FAINT,
    INK,
    NORMAL,
    ORANGE,
    haloed,
    sheet,
    svg,
)
from legato.report.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

HALF_PX = 18  # the template tells the width
ACROSS = 5


def marks(picture: "NDArray[np.uint8]", scene: Scene, solved: Mapping[str, Any]) -> str | None:
    """Return the close-ups of every mark that was found or is predicted in the picture."""
    found = {n: np.asarray(p, dtype=float) for n, p in (solved.get("marks") or {}).items()}
    names = scene.leg.names()
    predicted = dict(zip(names, scene.pixels(scene.leg.points()), strict=True))
    shown = [n for n in names if scene.intrinsics.sees(found.get(n, predicted[n]), 2.0)]
    if not shown:
        return None
    rows = -(-len(shown) // ACROSS)
    figure = sheet(1.8 * rows, left=0.05, right=0.05, top=0.25, bottom=0.05)
    figure.subplots_adjust(wspace=0.06, hspace=0.16)
    panels = figure.subplots(rows, ACROSS, squeeze=False).ravel()
    for axes, name in zip(panels, shown, strict=False):
        _closeup(axes, picture, name, found.get(name), predicted[name])
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    return svg(figure)


def _closeup(
    axes: "Axes", picture: "NDArray[np.uint8]", name: str, seen: Array | None, predicted: Array
) -> None:
    """Draw one mark: the picture's own pixels, stretched to the full range of greys."""
    u, v = np.rint(predicted if seen is None else seen).astype(int)
    left, top = max(u - HALF_PX, 0), max(v - HALF_PX, 0)
    crop = picture[top : v + HALF_PX + 1, left : u + HALF_PX + 1]
    extent = (left - 0.5, left + crop.shape[1] - 0.5, top + crop.shape[0] - 0.5, top - 0.5)
    axes.imshow(crop, cmap="gray", extent=extent, interpolation="none")
    crosses = [(predicted, "x", ORANGE, 9.0)]
    if seen is not None:
        crosses.append((seen, "+", BLUE, 16.0))
    for at, shape, colour, size in crosses:
        axes.plot(
            *at, shape, color=colour, markersize=size, markeredgewidth=1.2,
            path_effects=haloed(1.0),
        )  # fmt: skip
    axes.set_xlim(u - HALF_PX - 0.5, u + HALF_PX + 0.5)
    axes.set_ylim(v + HALF_PX + 0.5, v - HALF_PX - 0.5)
    missing = " (not found)" if seen is None else ""
    axes.set_title(name + missing, fontsize=NORMAL, color=INK, loc="left", pad=3)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color(FAINT)
