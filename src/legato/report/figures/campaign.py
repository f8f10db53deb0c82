"""Figures of several sessions: contacts by station, poses, quality, and where the time went."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from legato.report.compare import Comparison, Station
from legato.report.figures.canvas import (
    BLUE,
    GREEN,
    INK,
    NORMAL,
    ORANGE,
    RED,
    SMALL,
    SOFT,
    dressed,
    sheet,
    svg,
)
from legato.report.figures.curves import state_colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

ACROSS = 4  # panels beside each other
IN_A_ROW = 7  # names of a legend
LEAST_MM = 0.2  # the least that a panel of heights spans
IDLE = "idle"
SPREAD = "\N{PLUS-MINUS SIGN} their standard deviation"
AXIS_COLOURS = dict(zip("xyz", (RED, GREEN, BLUE), strict=True))


def contacts(found: Comparison) -> str | None:
    """Return every stroke's contact by session, a panel for each station, with mean and sd.

    Each panel has a scale of its own: sessions differ by far less than stations do.
    """
    if not found.stations:
        return None
    rows = -(-len(found.stations) // ACROSS)
    figure = sheet(2.5 * rows + 0.6, left=1.0, top=0.85)
    panels = figure.subplots(rows, ACROSS, squeeze=False).ravel()
    figure.subplots_adjust(wspace=0.62, hspace=0.5)
    words = {name: name for name in ("stroke", "mean of the sessions", SPREAD)}  # each told once
    for axes, station in zip(panels, found.stations, strict=False):
        _station(axes, station, words)
        _by_session(axes, [side.number for side in found.sides], most=5)
        _at_least(axes, LEAST_MM)
        axes.set_xlim(0.4, len(found.sides) + 0.6)
        axes.ticklabel_format(axis="y", useOffset=False)
        dressed(axes, x="session", title=f"{station.station_mm:g} mm", grid="y")
    for axes in panels[len(found.stations) :]:
        axes.set_visible(False)
    panels[0].set_ylabel("height over the\npredicted surface (mm)", fontsize=NORMAL, color=INK)
    drawn = [axes.get_legend_handles_labels() for axes in panels]
    handles = [handle for own, _ in drawn for handle in own]
    labels = [label for _, own in drawn for label in own]
    figure.legend(
        handles[::-1], labels[::-1],
        fontsize=SMALL, frameon=False, loc="upper left", ncols=3, bbox_to_anchor=(0.1, 1.0),
        borderaxespad=0.1,
    )  # fmt: skip
    return svg(figure)


def _station(axes: "Axes", station: Station, words: dict[str, str]) -> None:
    """Draw one station: strokes by session over the band of mean and standard deviation."""
    if station.mean is not None and station.between is not None:
        axes.axhspan(station.mean - station.between, station.mean + station.between,
                     color=ORANGE, alpha=0.25, lw=0, label=words.pop(SPREAD, ""))  # fmt: skip
    if station.mean is not None:
        axes.axhline(station.mean, color=ORANGE, linewidth=1.0,
                     label=words.pop("mean of the sessions", ""))  # fmt: skip
    for number, own in enumerate(station.contacts, start=1):
        places = number + 0.12 * (np.arange(len(own)) - (len(own) - 1) / 2)
        axes.plot(places, own, "o", color=BLUE, markersize=4.5, markeredgecolor="white",
                  markeredgewidth=0.5, label=words.pop("stroke", "") if own else "")  # fmt: skip


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
        (panels[0], [p.shift_mm for _, p in known], "mm", "Shift of its middle"),
        (panels[1], [p.turn_deg for _, p in known], "deg", "Turn"),
    ):
        axes.axhline(0.0, color=SOFT, linewidth=1.0)
        for axis, (name, colour) in enumerate(AXIS_COLOURS.items()):
            axes.plot(numbers, [v[axis] for v in values], "o-", color=colour, markersize=4,
                      linewidth=0.9, label=name)  # fmt: skip
        _by_session(axes, numbers)
        _at_least(axes, LEAST_MM / 10.0)
        dressed(axes, x="session", y=f"from the mean ({unit})", title=title)
        axes.legend(fontsize=SMALL, frameon=False, ncols=3, loc="lower right",
                    bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)  # fmt: skip
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
        _by_session(axes, numbers, most=6)
        dressed(axes, x="session", title=title, grid="y")
    return svg(figure)


def durations(found: Comparison) -> str | None:
    """Return each session's states as they came, s of the cell since it began."""
    names = list(dict.fromkeys(c.state for s in found.sides for c in s.course if c.state != IDLE))
    if not names:
        return None
    legend_rows = -(-len(names) // IN_A_ROW)
    figure = sheet(
        0.75 + 0.24 * len(found.sides) + 0.22 * legend_rows, left=0.6, top=0.1 + 0.22 * legend_rows
    )
    axes = figure.subplots()
    colours = dict(zip(names, _shades(names), strict=True))
    for row, side in enumerate(found.sides):
        for stay in side.course:
            if stay.state != IDLE:
                axes.barh(row, stay.seconds, left=stay.began, height=0.65, edgecolor="white",
                          linewidth=0.4, color=colours[stay.state])  # fmt: skip
    axes.set_yticks(range(len(found.sides)), [str(s.number) for s in found.sides])
    axes.invert_yaxis()
    axes.margins(x=0.01)
    dressed(axes, x="seconds of the cell since the session began", y="session", grid="x")
    figure.legend(
        [_patch(colours[name]) for name in names], names, fontsize=SMALL, frameon=False,
        loc="upper left", ncols=IN_A_ROW, bbox_to_anchor=(0.06, 1.0), borderaxespad=0.1,
    )  # fmt: skip
    return svg(figure)


def _shades(names: Sequence[str]) -> list[str]:
    """Return a colour for each state; the stations, which share one, go from light to dark."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    shared = [n for n in names if state_colour(n) == ORANGE]
    steps = np.linspace(0.35, 0.85, len(shared)) if len(shared) > 1 else [0.6]
    own = {n: to_hex(colormaps["Oranges"](step)) for n, step in zip(shared, steps, strict=False)}
    return [own.get(name, state_colour(name)) for name in names]


def _patch(colour: str) -> "Patch":
    """Return a colour's square for a legend."""
    from matplotlib.patches import Patch

    return Patch(color=colour)


def _at_least(axes: "Axes", span: float) -> None:
    """Widen a panel's heights to a span: what is far less than a motor's step is no spread."""
    low, high = axes.get_ylim()
    middle, half = (low + high) / 2.0, max(high - low, span) / 2.0
    axes.set_ylim(middle - half, middle + half)


def _by_session(axes: "Axes", numbers: Sequence[int], most: int = 12) -> None:
    """Mark whole sessions on the x axis, every one where there is room for `most` or fewer."""
    step = max(1, -(-len(numbers) // most))
    axes.set_xticks(list(numbers)[::step])
    axes.tick_params(labelsize=NORMAL)
