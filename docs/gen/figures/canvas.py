"""Figures of one look as SVG that takes its colours from the page, so that light and dark both fit.

Each colour is drawn as a stand-in and becomes a CSS variable. Text stays text.
"""

import io
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, SOFT, FAINT, PAPER = "#010101", "#010102", "#010103", "#010104"
BLUE, ORANGE, RED, GREEN, VIOLET = "#020201", "#020202", "#020203", "#020204", "#020205"
COLOURS = {
    INK: "ink", SOFT: "soft", FAINT: "faint", PAPER: "paper",
    BLUE: "blue", ORANGE: "orange", RED: "red", GREEN: "green", VIOLET: "violet",
}  # fmt: skip
WIDTH = 7.4  # inches
SMALL, NORMAL = 8.5, 9.5


def sheet(height: float, **margins: float) -> "Figure":
    """Return an empty figure of the page's width; height and margins in inches."""
    from matplotlib.figure import Figure

    side = {"left": 0.6, "right": 0.15, "top": 0.2, "bottom": 0.45} | margins
    figure = Figure(figsize=(WIDTH, height))
    figure.subplots_adjust(
        left=side["left"] / WIDTH,
        right=1 - side["right"] / WIDTH,
        top=1 - side["top"] / height,
        bottom=side["bottom"] / height,
        wspace=margins.get("between", 0.28),
    )
    return figure


def dressed(axes: "Axes", x: str = "", y: str = "", *, grid: bool = True) -> "Axes":
    """Give axes their labels and the look of the page."""
    axes.set_facecolor("none")
    axes.set_xlabel(x, color=SOFT, fontsize=NORMAL)
    axes.set_ylabel(y, color=SOFT, fontsize=NORMAL)
    axes.tick_params(colors=SOFT, labelsize=SMALL, which="both")
    for name, spine in axes.spines.items():
        spine.set_visible(name in ("left", "bottom"))
        spine.set_color(SOFT)
    if grid:
        axes.grid(color=FAINT, linewidth=0.7)
        axes.set_axisbelow(True)
    return axes


def bare(axes: "Axes") -> "Axes":
    """Take everything but the drawing off axes, and give both directions one scale."""
    axes.set_axis_off()
    axes.set_aspect("equal", adjustable="box")
    return axes


def note(axes: "Axes", text: str, at: tuple[float, float], colour: str = INK, **more: Any) -> None:
    """Write a note at a place of the data."""
    style: dict[str, Any] = {"fontsize": SMALL, "va": "center"} | more
    axes.text(*at, text, color=colour, **style)


def arrow(
    axes: "Axes", start: tuple[float, float], end: tuple[float, float], colour: str = INK
) -> None:
    """Draw an arrow between places of the data."""
    shape = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, start, arrowprops=shape)


def svg(figure: "Figure", name: str) -> str:
    """Return a figure as one SVG element for a page; ids carry the figure's name."""
    import matplotlib as mpl

    out = io.StringIO()
    with mpl.rc_context(
        {"svg.fonttype": "none", "svg.hashsalt": name, "font.family": "sans-serif"}
    ):
        figure.savefig(out, format="svg", transparent=True, metadata={"Date": None})
    text = out.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'<svg [^>]*?(viewBox="[^"]*")[^>]*>', r"<svg \1>", text, count=1)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'(href="#|url\(#)', rf"\g<1>{name}-", text)
    text = re.sub(r"font: ([\d.]+)px [^;\"]*", r"font-size: \1px", text)
    for stand_in, colour in COLOURS.items():
        text = text.replace(stand_in, f"var(--figure-{colour})")
    return text
