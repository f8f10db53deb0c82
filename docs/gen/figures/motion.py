"""How the arm goes: straight lines from bent pieces, one stroke, the lead-in."""

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from docs.gen.figures.canvas import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    ORANGE,
    PAPER,
    RED,
    SMALL,
    SOFT,
    VIOLET,
    arrow,
    bare,
    dressed,
    note,
    sheet,
    svg,
)  # fmt: skip
from legato.control.states import rows
from legato.control.states import states as named
from legato.geometry.arm import ArmModel, forward, joints_from_steps
from legato.geometry.motion import ToolPose, pose_steps, straight_path
from legato.geometry.transforms import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

START, END = ToolPose(127.0, -60.0, 120.0), ToolPose(127.0, 120.0, 120.0)


def chord() -> str:
    """Return how far the fingertip strays from a straight line that is cut into few pieces."""
    model = ArmModel()
    figure = sheet(2.7)
    axes = dressed(figure.add_subplot(), "way along the line, mm", "distance from the line, mm")
    a, b = START.vector(), END.vector()
    for pieces, colour in ((1, RED), (2, ORANGE), (4, GREEN)):
        ways, offs = _bends(model, a, b, pieces)
        axes.plot(ways, offs, color=colour, linewidth=1.4)
        at = int(np.argmax(offs[: len(offs) // max(pieces // 2, 1)]))
        label = "1 piece" if pieces == 1 else f"{pieces} pieces"
        axes.text(ways[at], offs[at] * 1.25, label, color=colour, fontsize=SMALL, ha="center")
    path = straight_path(model, START, END, scale=0.8)
    ways, offs = _bends(model, a, b, len(path))
    axes.plot(ways, offs, color=BLUE, linewidth=1.2)
    axes.text(
        ways[-1], 0.12, f"as sent: {len(path)} pieces", color=BLUE, fontsize=SMALL, ha="right"
    )
    axes.axhline(0.25, color=SOFT, linewidth=0.9, linestyle=(0, (4, 3)))
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylim(1e-3, 120)
    axes.set_xlim(0, 180)
    return svg(figure, "chord")


def _bends(model: ArmModel, a: Array, b: Array, pieces: int) -> tuple[Array, Array]:
    """Return the way along the line and the distance from it, where joints go evenly in pieces."""
    corners = pose_steps(model, a + np.linspace(0, 1, pieces + 1)[:, None] * (b - a))
    share = np.linspace(0, 1, 41)[:, None]
    steps = np.concatenate([p + share * (q - p) for p, q in pairwise(corners)])
    place, _, _ = forward(model, joints_from_steps(model, steps)[0])
    way = (b - a)[:3] / np.linalg.norm((b - a)[:3])
    along = (place - a[:3]) @ way
    off = np.linalg.norm(place - a[:3] - along[:, None] * way, axis=1)
    return along, np.maximum(off, 1e-4)


def stroke() -> str:
    """Return the fingertip's height over the predicted surface during one stroke."""
    figure = sheet(3.1)
    axes = dressed(figure.add_subplot(), "", "height over the predicted surface, mm", grid=False)
    touch, press, step = -0.34, 1.5, 0.5
    down = [10.0 - step * k for k in range(int((10.0 - touch) / step) + 1)]
    contact = down[-1] - step
    t, z = [0.0, 1.0], [10.0, 10.0]
    for k, height in enumerate([*down[1:], contact]):
        t += [1.0 + 0.2 * k + 0.12, 1.0 + 0.2 * (k + 1)]
        z += [height, height]
    touched = t[-1]
    depth = (down[-1] + contact) / 2 - press
    t += [touched + 0.5, touched + 1.5, touched + 2.6, touched + 3.2]
    z += [depth, depth, 10.0, 10.0]
    axes.axhspan(-2.0, 2.0, color=FAINT, alpha=0.6, linewidth=0)
    axes.axhline(0.0, color=SOFT, linewidth=0.9, linestyle=(0, (4, 3)))
    axes.plot(t, z, color=BLUE, linewidth=1.6)
    axes.plot(touched - 0.08, contact, "o", color=RED, markersize=5)
    right = touched + 3.2
    axes.text(0.05, 2.15, "contact window, ±2 mm", color=SOFT, fontsize=SMALL)
    axes.text(0.05, 0.3, "predicted surface", color=SOFT, fontsize=SMALL)
    axes.text(
        touched - 0.25, contact - 0.55, "the switch closes", color=RED, fontsize=SMALL, ha="right"
    )
    for text, x, y in (
        ("approach height", 0.05, 10.4), ("guarded steps, the switch read after each", 2.6, 8.2),
        ("press", touched + 0.05, depth - 0.6), ("dwell", touched + 0.85, depth - 0.6),
        ("retract", touched + 2.3, 5.0),
    ):  # fmt: skip
        axes.text(x, y, text, color=INK, fontsize=SMALL)
    axes.set_xlim(0, right)
    axes.set_ylim(-3.2, 11.4)
    axes.set_xticks([])
    axes.set_xlabel("time (not to scale)", color=SOFT, fontsize=SMALL)
    return svg(figure, "stroke")


def states() -> str:
    """Return the states of a run and the ways between them."""
    stations = (7.0, 67.0, 127.0, 187.0)
    places = {
        "idle": (0.0, 0.0), "capture": (1.15, 1.0), "calibrate": (2.3, 1.0), "verify": (3.45, 1.0),
        "move_home": (4.6, 1.0), "massage_7": (6.1, 2.2), "massage_67": (6.1, 1.4),
        "massage_127": (6.1, 0.6), "massage_187": (6.1, -0.2), "paused": (4.6, -0.75),
        "stopping": (2.3, -0.75), "fault": (0.0, -1.5),
    }  # fmt: skip
    if set(places) != set(named(stations)):
        raise ValueError("the figure does not show the table's states")
    drawn = {
        ("idle", "capture"), ("capture", "calibrate"), ("calibrate", "verify"),
        ("verify", "move_home"), ("move_home", "massage_7"), ("massage_7", "massage_67"),
        ("massage_67", "massage_127"), ("massage_127", "massage_187"), ("massage_187", "move_home"),
        ("move_home", "paused"), ("paused", "move_home"), ("paused", "stopping"),
        ("stopping", "idle"), ("stopping", "fault"), ("fault", "idle"), ("move_home", "stopping"),
    }  # fmt: skip
    if not drawn <= set(rows(stations)):
        raise ValueError("the figure shows a way that the table does not have")
    figure = sheet(3.6, left=0.1, right=0.1, top=0.1, bottom=0.1)
    axes = figure.add_subplot()
    axes.set_axis_off()
    for source, target in sorted(drawn):
        _way(axes, places[source], places[target])
    colours = {"fault": RED, "stopping": ORANGE, "paused": VIOLET, "idle": GREEN}
    for name, (x, y) in places.items():
        edge = colours.get(name, BLUE)
        box = {"boxstyle": "round,pad=0.35", "edgecolor": edge, "facecolor": PAPER}
        axes.text(x, y, name, ha="center", va="center", fontsize=SMALL, color=INK, bbox=box)
    axes.set_xlim(-0.5, 6.8)
    axes.set_ylim(-1.9, 2.5)
    return svg(figure, "states")


def _way(axes: "Axes", a: tuple[float, float], b: tuple[float, float]) -> None:
    level = abs(a[0] - b[0]) > 0.01
    ends = {"shrinkA": 24, "shrinkB": 28} if level else {"shrinkA": 10, "shrinkB": 10}
    style = {"arrowstyle": "-|>", "color": SOFT, "linewidth": 1.0, **ends}
    axes.annotate("", b, a, arrowprops=style)


def lead_in() -> str:
    """Return the way into a station from above: always from the same side."""
    figure = sheet(2.5, left=0.1, right=0.1, top=0.3, bottom=0.1, between=0.1)
    above, wheel = (bare(a) for a in figure.subplots(1, 2, width_ratios=(1.3, 1.0)))
    above.plot([0, 0], [-30, 34], color=FAINT, linewidth=26, solid_capstyle="butt")
    for y in (-18.0, 18.0):
        arrow(above, (0.0, y - 11), (0.0, y - 1.5), BLUE)
        above.plot(0, y, "o", color=RED, markersize=5)
        above.plot(0, y - 11, "o", color=BLUE, markersize=4)
    note(above, "station", (5, 18), RED)
    note(above, "lead-in: 8 mm to the robot's right", (5, 7), BLUE)
    note(above, "the leg, from above", (5, -30), SOFT)
    above.set_title("into a station from one side", color=SOFT, fontsize=SMALL, loc="left")
    above.set_xlim(-20, 90)
    above.set_ylim(-36, 36)
    turn = np.linspace(-1, 1, 200)
    play = 0.28
    wheel.plot(turn, turn - play, color=BLUE, linewidth=1.4)
    wheel.plot(turn, turn + play, color=ORANGE, linewidth=1.4)
    note(wheel, "going forward", (0.15, -0.5), BLUE)
    note(wheel, "going back", (-1.25, 0.12), ORANGE)
    wheel.set_title("joint over motor, with play", color=SOFT, fontsize=SMALL, loc="left")
    return svg(figure, "lead-in")
