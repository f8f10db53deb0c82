"""Curves: the search's cost, contact heights, press profiles, the timeline of states."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from legato.control.band import ACCEPTED, EXPECTED, Band
from legato.geometry.transforms import Array
from legato.report.figures.canvas import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    NORMAL,
    ORANGE,
    RED,
    SMALL,
    SOFT,
    VIOLET,
    WHY_COLOURS,
    dressed,
    sheet,
    svg,
)
from legato.report.figures.picture import runs

STATE_COLOURS = {
    "idle": FAINT,
    "capture": BLUE,
    "calibrate": VIOLET,
    "verify": GREEN,
    "move_home": SOFT,
    "paused": "#e3c34f",
    "stopping": "#3aa6b9",
    "fault": RED,
}


@dataclass(frozen=True)
class Stay:
    """One stay in a state: s since the session began."""

    state: str
    began: float
    ended: float

    @property
    def seconds(self) -> float:
        """How long it lasted."""
        return self.ended - self.began


def cost(
    best: Sequence[float | None], mean: Sequence[float | None], refined: float | None = None
) -> str:
    """Return best and mean cost (sum of squared px) by generation, on a log scale.

    None stands for a cost that is not finite; `refined` is the cost that refinement reached.
    """
    figure = sheet(3.0, left=0.8)
    axes = figure.subplots()
    for values, colour, name in ((mean, SOFT, "mean"), (best, BLUE, "best")):
        shown = np.asarray(values, dtype=float)
        shown = np.where(shown > 0.0, shown, np.nan)
        if np.isfinite(shown).any():
            last = shown[np.flatnonzero(np.isfinite(shown))[-1]]
            width = 1.6 if name == "best" or len(shown) < 300 else 0.7
            label = f"{name}, {last:.3g} at last"
            axes.semilogy(shown, color=colour, linewidth=width, label=label)
    if refined:
        label = f"after refinement, {refined:.3g}"
        axes.axhline(refined, color=GREEN, linewidth=1.2, linestyle="--", label=label)
    dressed(axes, x="generation", y="cost (sum of squares, px²)")
    axes.legend(fontsize=SMALL, frameon=False, loc="best")
    return svg(figure)


def contact_heights(
    contacts: Sequence[Mapping[str, Any]],
    bands: Mapping[float, Band],
    step_mm: float = 0.0,
    ended: Mapping[str, Any] | None = None,
) -> str:
    """Return touched heights over the predicted surface, beside both bands of each station.

    A touch lies within half a step of the descent, `step_mm`, of where it is drawn; `ended` is the
    touch that ended the session in a fault.
    """
    stations = list(bands)
    figure = sheet(2.9, left=0.85, top=0.35)
    axes = figure.subplots()
    axes.axhline(0.0, color=SOFT, linewidth=1.0)
    told = f"touched, within the descent\u2019s step of {step_mm:g} mm" if step_mm else "touched"
    words = {name: name for name in (EXPECTED, ACCEPTED, told)}  # each is told once
    for place, station in enumerate(stations):
        band = bands[station]
        if band.expected_mm:
            axes.fill_between(
                [place - 0.3, place + 0.3], -band.expected_mm, band.expected_mm, color=BLUE,
                alpha=0.2, lw=0, label=words.pop(EXPECTED, None),
            )  # fmt: skip
        if band.accepted_mm:
            axes.hlines(
                [-band.accepted_mm, band.accepted_mm], place - 0.42, place + 0.42, color=ORANGE,
                linewidth=1.2, linestyle="--", label=words.pop(ACCEPTED, ""),
            )  # fmt: skip
        own = [c for c in contacts if float(c["station_mm"]) == station]
        offsets = (np.arange(len(own)) - (len(own) - 1) / 2) * min(0.12, 0.5 / max(len(own), 1))
        heights = [float(c["contact_mm"]) for c in own]
        if own:
            axes.errorbar(
                place + offsets, heights, yerr=step_mm / 2.0 if step_mm else None, fmt="o",
                color=RED, ecolor=RED, elinewidth=1.0, markersize=5, markeredgecolor="white",
                label=words.pop(told, None),
            )  # fmt: skip
        if ended is not None and ended["station_mm"] == station:
            axes.plot(place, ended["height_mm"], "X", color=INK, markersize=9,
                      markeredgecolor="white", label="the touch that ended it")  # fmt: skip
    axes.set_xticks(range(len(stations)), [f"{s:g} mm" for s in stations])
    axes.set_xlim(-0.6, len(stations) - 0.4)
    dressed(axes, x="station", y="height over the\npredicted surface (mm)", grid="y")
    axes.legend(
        fontsize=SMALL,
        frameon=False,
        loc="upper left",
        ncols=4,
        bbox_to_anchor=(0, 1.17),
        borderaxespad=0.0,
    )
    return svg(figure)


def press_profiles(
    profiles: Mapping[float, Sequence[tuple[Array, Array, Array]]], seconds: str = "s"
) -> str:
    """Return the fingertip's height over the predicted surface in each stroke, by station.

    `profiles` holds for each stroke its times (N,), heights (N,) in mm and whys (N,); `seconds`
    says whose the times are.
    """
    figure = sheet(2.7, top=0.3, bottom=0.8)
    panels = figure.subplots(1, len(profiles), sharey=True, squeeze=False)[0]
    for axes, (station, strokes) in zip(panels, profiles.items(), strict=True):
        for times, heights, whys in strokes:
            line = np.stack([times, heights], axis=-1)
            for why, colour in WHY_COLOURS.items():
                piece = runs(whys, line, why)
                if np.isfinite(piece).any():
                    label = why if axes is panels[0] else None
                    axes.plot(*piece.T, color=colour, linewidth=1.3, label=label)
        axes.axhline(0.0, color=SOFT, linewidth=1.0)
        dressed(axes, x=seconds, title=f"{station:g} mm", grid="y")
    panels[0].set_ylabel("height (mm)", fontsize=NORMAL, color=INK)
    handles, labels = panels[0].get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    figure.legend(
        list(unique.values()), list(unique), loc="lower center", ncols=5, fontsize=SMALL,
        frameon=False,
    )  # fmt: skip
    return svg(figure)


def timeline(stays: Sequence[Stay]) -> str:
    """Return the states as bars over time, one row for each state."""
    names = list(dict.fromkeys(s.state for s in stays))
    figure = sheet(0.65 + 0.27 * len(names), left=1.15)
    axes = figure.subplots()
    end = max(s.ended for s in stays) or 1.0
    for stay in stays:
        row = names.index(stay.state)
        width = max(stay.seconds, end * 0.002)  # a stay of no length is still seen
        axes.barh(row, width, left=stay.began, height=0.62, color=state_colour(stay.state))
    for row, name in enumerate(names):
        own = [s for s in stays if s.state == name]
        total = sum(s.seconds for s in own)
        times = f", {len(own)} times" if len(own) > 1 else ""
        axes.annotate(
            f"{total:.2f} s{times}", (max(s.ended for s in own), row), xytext=(5, 0),
            textcoords="offset points", va="center", fontsize=SMALL, color=SOFT,
        )  # fmt: skip
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlim(0.0, end * 1.14)
    dressed(axes, x="seconds of the cell since the session began", grid="x")
    axes.tick_params(axis="y", colors=INK, length=0)
    return svg(figure)


def state_colour(state: str) -> str:
    """Return a state's colour; the massage states share one."""
    return STATE_COLOURS.get(state, ORANGE)
