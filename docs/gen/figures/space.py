"""The cell from above and from the side, the leg and its marks."""

from typing import TYPE_CHECKING

import numpy as np

from docs.gen.figures.canvas import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    RED,
    SMALL,
    SOFT,
    VIOLET,
    arrow,
    bare,
    note,
    sheet,
    svg,
)  # fmt: skip
from docs.gen.figures.scene import COPLANAR, STATIONS, Scene, scene
from legato.geometry.arm import ArmModel, backward, skeleton
from legato.geometry.leg import Leg
from legato.geometry.transforms import Array, apply

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LENGTH = 38.0  # mm, of the axes that are drawn


def frames() -> str:
    """Return the four frames in the cell, from above and from the camera's side."""
    cell = scene()
    figure = sheet(3.9, left=0.1, right=0.1, top=0.3, bottom=0.1)
    arm = skeleton(ArmModel(), backward(ArmModel(), [127.0, 0.0, 150.0], -np.pi / 2, 0.0))
    views = (("from above", (0, 1)), ("from the robot's right side", (0, 2)))
    for place, (title, (h, v)) in enumerate(views, start=1):
        axes = bare(figure.add_subplot(1, 2, place))
        axes.set_title(title, color=SOFT, fontsize=SMALL, loc="left")
        outline = _from_above(cell.leg, cell.world_from_object)
        if v == 1:
            axes.fill(outline[:, h], outline[:, v], facecolor=FAINT, edgecolor=SOFT)
        else:
            _end_on(axes, cell)
        axes.plot(arm[:, h], arm[:, v], color=SOFT, linewidth=5, solid_capstyle="round", alpha=0.5)
        if v == 2:
            axes.plot([0, 0], [0, arm[0, 2]], color=SOFT, linewidth=8, alpha=0.5)
            axes.axhline(0.0, color=SOFT, linewidth=0.8)
        tool = np.eye(4)
        tool[:3, :3] = cell.world_from_object[:3, :3] @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
        tool[:3, 3] = arm[3]
        for name, pose in (
            ("W", np.eye(4)), ("C", cell.world_from_camera), ("O", cell.world_from_object),
            ("T", tool),
        ):  # fmt: skip
            _axes_of(axes, name, pose, h, v)
        axes.set_xlim(-30, 270)
        axes.set_ylim(*((-160, 160) if v == 1 else (-25, 400)))
    return svg(figure, "frames")


def _axes_of(axes: "Axes", name: str, pose: Array, h: int, v: int) -> None:
    """Draw a frame's axes where they do not point at the reader."""
    at = pose[:3, 3]
    for label, colour, way in zip("xyz", (RED, GREEN, BLUE), pose[:3, :3].T, strict=True):
        end = at + LENGTH * way
        if np.hypot(end[h] - at[h], end[v] - at[v]) > 0.25 * LENGTH:
            arrow(axes, (at[h], at[v]), (end[h], end[v]), colour)
            tip = at + 1.25 * LENGTH * way
            note(axes, label, (tip[h], tip[v]), colour, ha="center")
    note(axes, name, (at[h] - 11, at[v] - 11), INK, ha="center", weight="bold", fontsize=11)


def _from_above(leg: Leg, pose: Array) -> Array:
    """Return the leg's outline from above."""
    left, right = np.pi / 2, -np.pi / 2
    ends = [(0.0, left), (leg.length, left), (leg.length, right), (0.0, right)]
    return apply(pose, np.array([leg.surface_point(x, a) for x, a in ends]))


def _end_on(axes: "Axes", cell: Scene) -> None:
    """Draw the leg as it is seen along its axis: its two faces."""
    turn = np.linspace(0.0, 2.0 * np.pi, 80)
    for x in (0.0, cell.leg.length):
        edge = apply(cell.world_from_object, cell.leg.surface_point(np.full(80, x), turn))
        axes.fill(edge[:, 0], edge[:, 2], facecolor=FAINT, edgecolor=SOFT)


def leg() -> str:
    """Return the leg from the camera's side and from the big face, with marks and stations."""
    model = Leg()
    figure = sheet(2.7, left=0.1, right=0.1, top=0.3, bottom=0.1)
    side, face = (bare(a) for a in figure.subplots(1, 2, width_ratios=(3.1, 1.0)))
    ends = np.array([[0, 1], [1, 1], [1, -1], [0, -1]], dtype=float)
    radius = np.where(ends[:, 0] > 0, model.small_radius, model.big_radius)
    side.fill(ends[:, 0] * model.length, ends[:, 1] * radius, facecolor=FAINT, edgecolor=SOFT)
    side.plot([-12, model.length + 16], [0, 0], color=SOFT, linewidth=0.8, linestyle=(0, (6, 3)))
    turn = np.linspace(0, 2 * np.pi, 100)
    for r in (model.big_radius, model.small_radius):
        face.plot(r * np.sin(turn), r * np.cos(turn), color=SOFT, linewidth=1)
    for name, (x, y, z) in model.marks.items():
        flat = name in COPLANAR
        colour = BLUE if flat else ORANGE
        side.plot(x, z, "s", color=colour, markersize=5)
        face.plot(-y, z, "s", color=colour, markersize=5)
        left = name in ("P1", "P8")
        beside, way = (x - 4, "right") if left else (x + 3.5, "left")
        note(side, name, (beside, z + 4.5), colour, ha=way)
    for name in ("P1", "P2", "P5", "P8"):
        _, y, z = model.marks[name]
        note(face, name, (-y + 3, z + 3), BLUE if name in COPLANAR else ORANGE)
    for station in STATIONS:
        top = float(model.radius(station))
        arrow(side, (station, top + 14), (station, top + 1), RED)
        note(side, f"{station:g}", (station, top + 18), RED, ha="center")
    p2, p5 = np.array(model.marks["P2"]), np.array(model.marks["P5"])
    way = (p5 - p2) / np.linalg.norm(p5 - p2)
    line = np.array([p2 - 16 * way, p5 + 22 * way])
    face.plot(-line[:, 1], line[:, 2], color=BLUE, linewidth=1, linestyle=(0, (2, 2)))
    titles = ("from the camera's side, mm from the big face", "onto the big face")
    for axes, title in zip((side, face), titles, strict=True):
        axes.set_title(title, color=SOFT, fontsize=SMALL, loc="left")
        axes.set_ylim(-38, 56)
    return svg(figure, "leg")


def arm() -> str:
    """Return the arm from the side with the angles and lengths of the kinematics."""
    model = ArmModel()
    tip = np.array([203.2, 0.0, 60.0])
    pitch = np.radians(-70.0)
    joints = backward(model, tip, pitch, 0.0)
    points = skeleton(model, joints)[:, [0, 2]]
    figure = sheet(4.4, left=0.1, right=0.1, top=0.1, bottom=0.1)
    axes = bare(figure.add_subplot())
    axes.axhline(0.0, color=SOFT, linewidth=0.8)
    axes.plot([0, 0], [0, points[0, 1]], color=SOFT, linewidth=9, alpha=0.45)
    axes.plot(*points.T, color=SOFT, linewidth=7, alpha=0.45, solid_capstyle="round")
    axes.plot(*points[:-1].T, "o", color=INK, markersize=5)
    axes.plot(*points[-1], "o", color=RED, markersize=5)
    for k, (name, angle, colour) in enumerate(
        (("T2", joints[1], BLUE), ("T3", joints[2], GREEN), ("P", joints[3], ORANGE))
    ):
        x, z = points[k]
        axes.plot([x, x + 62], [z, z], color=colour, linewidth=0.8, linestyle=(0, (4, 3)))
        turn = np.linspace(0.0, float(angle), 40)
        axes.plot(x + 42 * np.cos(turn), z + 42 * np.sin(turn), color=colour, linewidth=1.4)
        middle = float(angle) / 2
        note(axes, name, (x + 54 * np.cos(middle), z + 54 * np.sin(middle)), colour, ha="center")
    for k, name in enumerate(("L", "L", "LL")):
        at = (points[k] + points[k + 1]) / 2
        way = points[k + 1] - points[k]
        off = 13 * np.array([-way[1], way[0]]) / np.linalg.norm(way)
        note(axes, name, (at[0] + off[0], at[1] + off[1]), INK, ha="center")
    note(axes, "H", (-15, points[0, 1] / 2), INK, ha="center")
    note(axes, "shoulder", (points[0, 0] - 8, points[0, 1] + 13), SOFT, ha="right")
    note(axes, "elbow", (points[1, 0], points[1, 1] + 14), SOFT, ha="center")
    note(axes, "wrist", (points[2, 0] + 12, points[2, 1] + 8), SOFT)
    note(axes, "fingertip: RR, Z", (points[3, 0] + 10, points[3, 1]), RED)
    axes.plot(*points[[0, 2]].T, color=VIOLET, linewidth=1, linestyle=(0, (1, 2)))
    at = 0.55 * points[2] + 0.45 * points[0]
    note(axes, "hypot(R0, Z0)", (at[0] - 6, at[1] - 13), VIOLET, ha="right")
    axes.set_xlim(-150, 420)
    axes.set_ylim(-12, 335)
    return svg(figure, "arm")
