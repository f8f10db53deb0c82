"""What is drawn over the camera's picture: marks, residuals, the leg, stations, the trajectory."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from legato.geometry.transforms import Array
from legato.report.figures.canvas import (
    BLUE,
    GREEN,
    LAYERS,
    NORMAL,
    ORANGE,
    RED,
    WHY_COLOURS,
    haloed,
    overlay,
    round_scale,
    svg,
)
from legato.report.scene import Scene, silhouette, surface_samples

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ARROW_PX = 38.0


def marks_overlay(scene: Scene, solved: Mapping[str, Any]) -> tuple[str, float]:
    """Return the marks found and predicted, with residuals magnified, and by how much."""
    i = scene.intrinsics
    figure, axes = overlay(i.width, i.height)
    _leg(axes, scene)
    _stations(axes, scene)
    found = {n: np.asarray(p, dtype=float) for n, p in (solved.get("marks") or {}).items()}
    residuals = {n: np.asarray(r, dtype=float) for n, r in (solved.get("residuals") or {}).items()}
    largest = max((float(np.hypot(*r)) for r in residuals.values()), default=0.0)
    scale = round_scale(largest, ARROW_PX)
    for name, point in scene.leg.marks.items():
        predicted = scene.pixels(np.asarray(point)[None])[0]
        seen = found.get(name)
        if seen is None:
            _cross(axes, predicted, ORANGE, "x", faint=True)
            _label(axes, predicted, f"{name} missing", ORANGE)
            continue
        _cross(axes, predicted, ORANGE, "x")
        _cross(axes, seen, BLUE, "+")
        if name in residuals:
            _arrow(axes, seen, residuals[name] * scale)
        _label(axes, seen, name, BLUE)
    return svg(figure), scale


def trajectory_overlay(
    scene: Scene, path: Mapping[str, Array], contacts: Sequence[Mapping[str, Any]]
) -> str:
    """Return the fingertip's way as the camera saw it (paper figure 5.4b)."""
    i = scene.intrinsics
    figure, axes = overlay(i.width, i.height)
    _leg(axes, scene)
    _stations(axes, scene)
    pixels = scene.pixels_of_world(np.stack([path["x"], path["y"], path["z"]], axis=-1))
    for why, wide in LAYERS:
        u, v = runs(path["why"], pixels, why).T
        halo = haloed(1.8) if why not in ("descend", "press") else None
        axes.plot(u, v, color=WHY_COLOURS[why], linewidth=1.8 * wide, path_effects=halo)
    touched = [c["xyz_mm"] for c in contacts if c.get("xyz_mm")]
    if touched:
        u, v = scene.pixels_of_world(np.asarray(touched, dtype=float)).T
        axes.plot(u, v, "o", color=RED, markersize=5, markeredgecolor="white")
    return svg(figure)


def runs(whys: Array, points: Array, why: str) -> Array:
    """Return the points (M, D) of all motions of one kind, kept apart by rows of NaN.

    A row of a trajectory is where a motion ended: each run has the point that it began at, too.
    """
    of_kind = np.flatnonzero(np.asarray(whys) == why)
    gap = np.full((1, points.shape[1]), np.nan)
    if not of_kind.size:
        return gap
    pieces = []
    for run in np.split(of_kind, np.flatnonzero(np.diff(of_kind) > 1) + 1):
        pieces += [points[max(run[0] - 1, 0) : run[-1] + 1], gap]
    return np.vstack(pieces)


def _leg(axes: "Axes", scene: Scene) -> None:
    """Draw the projected outline of the leg and the rims of its faces."""
    pixels = scene.pixels(surface_samples(scene.leg))
    if not np.isfinite(pixels).all():
        return
    axes.plot(*silhouette(pixels).T, color=GREEN, linewidth=1.5, path_effects=haloed(1.5))
    for x in (0.0, scene.leg.length):
        axes.plot(*_ring(scene, x).T, color=GREEN, linewidth=1.0)


def _stations(axes: "Axes", scene: Scene) -> None:
    """Draw each station's ring as far as it is seen, and the station on the top line."""
    for station in scene.stations:
        axes.plot(*_ring(scene, station).T, color=GREEN, linewidth=1.0, linestyle=(0, (4, 2)))
        top = scene.pixels(scene.leg.surface_point(station)[None])[0]
        axes.plot(*top, "o", color=GREEN, markersize=5, markeredgecolor="white")
        _label(axes, top, f"{station:g} mm", GREEN, up=14.0)


def _ring(scene: Scene, x: float) -> Array:
    """Return the pixels (N, 2) of the ring about the leg at `x`, NaN where it is hidden."""
    angle = np.linspace(-np.pi, np.pi, 181)
    pixels = scene.pixels(scene.leg.surface_point(x, angle))
    return np.where(scene.visible(x, angle)[:, None], pixels, np.nan)


def _cross(axes: "Axes", at: Array, colour: str, shape: str, *, faint: bool = False) -> None:
    axes.plot(
        *at, shape, markersize=13 if shape == "+" else 7, markeredgewidth=1.2, color=colour,
        alpha=0.6 if faint else 1.0, path_effects=haloed(1.2),
    )  # fmt: skip


def _arrow(axes: "Axes", start: Array, step: Array) -> None:
    """Draw one magnified residual from where the mark was seen."""
    axes.annotate(
        "",
        xy=tuple(start + step),
        xytext=tuple(start),
        arrowprops={
            "arrowstyle": "-|>",
            "color": RED,
            "linewidth": 1.6,
            "shrinkA": 0,
            "shrinkB": 0,
        },
    )


def _label(axes: "Axes", at: Array, text: str, colour: str, up: float = 9.0) -> None:
    axes.annotate(
        text,
        xy=tuple(at),
        xytext=(7.0, up - 2.0),
        textcoords="offset points",
        fontsize=NORMAL + 1,
        fontweight="bold",
        color=colour,
        path_effects=haloed(1.4),
        annotation_clip=True,
    )
