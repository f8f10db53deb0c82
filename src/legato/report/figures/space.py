"""The fingertip's way in the robot base frame: from above, the side and the end (figure 5.4a)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from legato.geometry.transforms import Array, apply
from legato.report.figures.canvas import (
    FAINT,
    GREEN,
    INK,
    LAYERS,
    NORMAL,
    RED,
    SMALL,
    SOFT,
    WHY_COLOURS,
    WIDTH,
    dressed,
    limits,
    sheet,
    svg,
)
from legato.report.figures.picture import runs
from legato.report.scene import Scene, silhouette, surface_samples

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = "xyz"


def views(
    path: Mapping[str, Array],
    scene: Scene | None,
    contacts: Sequence[Mapping[str, Any]],
    true_pose: Array | None = None,
    table_z: float = 0.0,
) -> str:
    """Return three views: from above, from the side, and along the leg from its big face."""
    along = 1 if scene is None or abs(scene.world_from_object[1, 0]) > 0.7 else 0
    across = 1 - along
    places = np.stack([path["x"], path["y"], path["z"]], axis=-1)
    spans = [_span(places, scene, axis) for axis in range(3)]
    spans[2] = (min(spans[2][0], table_z - 8.0), spans[2][1])
    figure, (above, side, end) = _panels([spans[a][1] - spans[a][0] for a in (along, across, 2)])
    for axes, plane in ((above, (along, across)), (side, (along, 2)), (end, (across, 2))):
        _draw(axes, plane, path["why"], places, scene, contacts, true_pose)
        axes.set_xlim(spans[plane[0]])
        axes.set_ylim(spans[plane[1]])
    if along == 1:  # y to the right is a view from above only where x runs down
        above.invert_yaxis()
    else:  # who looks along x has y to the left
        end.invert_xaxis()
    for axes in (side, end):
        axes.axhline(table_z, color=SOFT, linewidth=1.0)
    side.annotate("table", (spans[along][0] + 3.0, table_z - 6.0), fontsize=SMALL, color=SOFT)
    dressed(above, y=f"{NAMES[across]} (mm)", title="From above")
    dressed(side, x=f"{NAMES[along]} (mm)", y="z (mm)", title="From the side")
    dressed(end, x=f"{NAMES[across]} (mm)", title="From the end")
    handles, labels = above.get_legend_handles_labels()
    corner = end.get_position()
    figure.legend(
        handles, labels, loc="center left", fontsize=SMALL, frameon=False,
        bbox_to_anchor=(corner.x0, (above.get_position().y0 + above.get_position().y1) / 2.0),
    )  # fmt: skip
    return svg(figure)


def _panels(spans: Sequence[float]) -> tuple["Figure", tuple["Axes", "Axes", "Axes"]]:
    """Return a sheet with three views of one scale, for spans along, across and up in mm."""
    along, across, up = spans
    left, gap, right, top, between, bottom = 0.75, 0.45, 0.15, 0.35, 0.55, 0.5
    scale = (WIDTH - left - gap - right) / (along + across)
    height = top + between + bottom + scale * (across + up)
    figure = sheet(height)

    def panel(x: float, y: float, wide: float, tall: float) -> "Axes":
        place = (x / WIDTH, y / height, scale * wide / WIDTH, scale * tall / height)
        return figure.add_axes(place)

    above = panel(left, bottom + scale * up + between, along, across)
    side = panel(left, bottom, along, up)
    return figure, (above, side, panel(left + scale * along + gap, bottom, across, up))


def _span(places: Array, scene: Scene | None, axis: int) -> tuple[float, float]:
    """Return the range that one axis shows."""
    values = [places[:, axis]]
    if scene is not None:
        values.append(apply(scene.world_from_object, surface_samples(scene.leg))[:, axis])
    return limits(np.concatenate(values), 12.0)


def _draw(
    axes: "Axes",
    plane: tuple[int, int],
    whys: Array,
    places: Array,
    scene: Scene | None,
    contacts: Sequence[Mapping[str, Any]],
    true_pose: Array | None,
) -> None:
    """Draw the leg, its stations, the way and the contacts in one plane of the robot's frame."""
    if scene is not None:
        samples = surface_samples(scene.leg)
        outline = silhouette(apply(scene.world_from_object, samples)[:, plane])
        axes.fill(*outline.T, color=FAINT, alpha=0.6, linewidth=0.0)
        axes.plot(*outline.T, color=SOFT, linewidth=1.2, label="leg, estimated")
        if true_pose is not None:
            outline = silhouette(apply(true_pose, samples)[:, plane])
            axes.plot(*outline.T, color=INK, linewidth=0.9, linestyle=":", label="leg, true")
        _stations(axes, plane, scene)
    for why, wide in LAYERS:
        way = runs(whys, places[:, plane], why)
        if np.isfinite(way).any():
            axes.plot(*way.T, color=WHY_COLOURS[why], linewidth=1.3 * wide, label=why)
    touched = [c["xyz_mm"] for c in contacts if c.get("xyz_mm")]
    if touched:
        at = np.asarray(touched, dtype=float)[:, plane]
        axes.plot(*at.T, "o", color=RED, markersize=4, markeredgecolor="white", label="contact")


def _stations(axes: "Axes", plane: tuple[int, int], scene: Scene) -> None:
    """Draw the stations on the top line and their places along the leg."""
    tops = scene.leg.surface_point(np.array(scene.stations))
    points = apply(scene.world_from_object, tops)[:, plane]
    axes.plot(*points.T, "D", color=GREEN, markersize=4, label="station", linestyle="none")
    if np.ptp(points[:, 0]) < 30.0:  # from the end the names would lie on each other
        return
    for station, point in zip(scene.stations, points, strict=True):
        axes.annotate(
            f"{station:g} mm",
            xy=tuple(point),
            xytext=(5.0, -11.0),
            textcoords="offset points",
            fontsize=NORMAL,
            color=GREEN,
        )
