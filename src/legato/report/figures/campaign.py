"""Figures of several sessions: contacts by station, poses, quality, and where the time went."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from legato.report.compare import Comparison
from legato.report.figures.canvas import (
    BLUE,
    GREEN,
    INK,
    NORMAL,
    ORANGE,
    RED,
    SMALL,
    SOFT,
    VIOLET,
    dressed,
    sheet,
    svg,
)
from legato.report.figures.curves import state_colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = (BLUE, ORANGE, GREEN, VIOLET, RED, "#3aa6b9", "#8c6d31", SOFT)
AXIS_COLOURS = dict(zip("xyz", (RED, GREEN, BLUE), strict=True))


def contacts(found: Comparison) -> str | None:
    """Return every stroke's contact by station, a colour for each session, with mean and sd."""
    if not found.stations:
        return None
    figure = sheet(3.1, left=0.85, top=0.4)
    axes = figure.subplots()
    axes.axhline(0.0, color=SOFT, linewidth=1.0)
    count = len(found.sides)
    for place, station in enumerate(found.stations):
        for side, own in zip(found.sides, station.contacts, strict=True):
            offset = 0.7 * ((side.number - 0.5) / count - 0.5)
            axes.plot(
                np.full(len(own), place + offset), own, "o", color=_colour(side.number),
                markersize=4.5, markeredgecolor="white", markeredgewidth=0.5,
                label=f"session {side.number}" if place == 0 and count <= len(COLOURS) else None,
            )  # fmt: skip
        if station.mean is not None:
            spread = station.between or 0.0
            axes.fill_between(
                [place - 0.4, place + 0.4], station.mean - spread, station.mean + spread,
                color=SOFT, alpha=0.18, lw=0,
                label="mean ± sd of sessions" if place == 0 else None,
            )  # fmt: skip
            axes.plot([place - 0.4, place + 0.4], [station.mean] * 2, color=INK, linewidth=0.9)
    axes.set_xticks(range(len(found.stations)), [f"{s.station_mm:g} mm" for s in found.stations])
    axes.set_xlim(-0.6, len(found.stations) - 0.4)
    dressed(axes, x="station", y="height over the\npredicted surface (mm)", grid="y")
    axes.legend(
        fontsize=SMALL, frameon=False, loc="lower left", ncols=6, bbox_to_anchor=(0, 1.0),
        borderaxespad=0.0, columnspacing=1.2, handletextpad=0.4,
    )  # fmt: skip
    return svg(figure)


def poses(found: Comparison) -> str | None:
    """Return where each session found the leg against their mean: shifts and turns by axis."""
    known = [(s.number, s.pose) for s in found.sides if s.pose is not None]
    if len(known) < 2:
        return None
    figure = sheet(2.8, left=0.75, top=0.35)
    panels = figure.subplots(1, 2)
    figure.subplots_adjust(wspace=0.22)
    numbers = [number for number, _ in known]
    for axes, values, unit, title in (
        (panels[0], [p.shift_mm for _, p in known], "mm", "Shift of the leg's middle"),
        (panels[1], [p.turn_deg for _, p in known], "deg", "Turn of the leg"),
    ):
        axes.axhline(0.0, color=SOFT, linewidth=1.0)
        for axis, (name, colour) in enumerate(AXIS_COLOURS.items()):
            label = f"along {name}" if unit == "mm" else f"about {name}"
            axes.plot(numbers, [v[axis] for v in values], "o-", color=colour, markersize=4,
                      linewidth=0.9, label=label)  # fmt: skip
        _by_session(axes, numbers)
        dressed(axes, x="session", y=f"from the mean ({unit})", title=title)
        axes.legend(fontsize=SMALL, frameon=False, ncols=3, loc="best")
    return svg(figure)


def quality(found: Comparison) -> str | None:
    """Return residuals, predicted uncertainty and true error by session, those there are."""
    rows = (
        ("Residual, rms (px)", [s.rms_px for s in found.sides], BLUE),
        (
            "Worst station, 1 \N{GREEK SMALL LETTER SIGMA} (mm)",
            [s.sigma_mm for s in found.sides],
            GREEN,
        ),
        ("Worst station, true (mm)", [s.error_mm for s in found.sides], RED),
    )
    shown = [row for row in rows if any(v is not None for v in row[1])]
    if not shown:
        return None
    figure = sheet(2.3, left=0.6, top=0.35)
    panels = figure.subplots(1, len(shown), squeeze=False)[0]
    figure.subplots_adjust(wspace=0.28)
    numbers = [s.number for s in found.sides]
    for axes, (title, values, colour) in zip(panels, shown, strict=True):
        axes.bar(numbers, [v or 0.0 for v in values], color=colour, width=0.6)
        _by_session(axes, numbers)
        dressed(axes, x="session", title=title, grid="y")
    return svg(figure)


def durations(found: Comparison) -> str | None:
    """Return how long each session stayed in each state, s of the cell."""
    names = list(dict.fromkeys(n for s in found.sides for n in s.stays if n != "idle"))
    if not names:
        return None
    figure = sheet(0.95 + 0.24 * len(found.sides), left=0.6, right=1.5)
    axes = figure.subplots()
    reached = np.zeros(len(found.sides))
    rows = np.arange(len(found.sides))
    shades: dict[str, int] = {}
    for name in names:
        seconds = np.array([s.stays.get(name, 0.0) for s in found.sides])
        colour = state_colour(name)
        shades[colour] = shades.get(colour, 0) + 1
        axes.barh(rows, seconds, left=reached, height=0.65, color=colour, label=name,
                  alpha=1.0 / (1.0 + 0.35 * (shades[colour] - 1)))  # fmt: skip
        reached += seconds
    axes.set_yticks(rows, [str(s.number) for s in found.sides])
    axes.invert_yaxis()
    dressed(axes, x="seconds of the cell", y="session", grid="x")
    axes.legend(fontsize=SMALL, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return svg(figure)


def _by_session(axes: "Axes", numbers: Sequence[int]) -> None:
    """Mark whole sessions on the x axis, every one where there is room."""
    step = max(1, -(-len(numbers) // 12))
    axes.set_xticks(list(numbers)[::step])
    axes.tick_params(labelsize=NORMAL)


def _colour(number: int) -> str:
    """Return a session's colour."""
    return COLOURS[(number - 1) % len(COLOURS)]
