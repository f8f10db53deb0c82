"""Figures of one look, and pictures as data URIs.

Vector output is embedded as an image, so that ids of one figure never meet another's.
"""

import base64
import io
from typing import TYPE_CHECKING

import numpy as np

from legato.geometry.transforms import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

INK, SOFT, FAINT = "#1c2733", "#66727f", "#d9dee3"
BLUE, ORANGE, RED, GREEN, VIOLET = "#2166ac", "#d9791a", "#c1272d", "#2a7f4f", "#6b4c9a"
WHY_COLOURS = {
    "transit": "#9aa5b1",
    "approach": BLUE,
    "descend": ORANGE,
    "press": RED,
    "retract": GREEN,
}
# Up and down are one line: the wide one lies below, so that both are seen.
LAYERS = (("transit", 1.0), ("approach", 1.0), ("retract", 3.0), ("descend", 1.3), ("press", 1.3))
WIDEST_PICTURE = 1280
SMALL, NORMAL = 8.0, 9.0
WIDTH = 8.6  # inches


def sheet(
    height: float,
    *,
    left: float = 0.75,
    right: float = 0.15,
    top: float = 0.15,
    bottom: float = 0.5,
) -> "Figure":
    """Return an empty figure of the page's width; height and margins are inches.

    The margins are given and not found by trial, which would draw each figure twice over.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), facecolor="white")
    figure.subplots_adjust(
        left=left / WIDTH, right=1 - right / WIDTH, top=1 - top / height, bottom=bottom / height
    )
    return figure


def dressed(
    axes: "Axes", *, x: str = "", y: str = "", title: str = "", grid: str = "both"
) -> "Axes":
    """Give axes their labels with units and the report's look; returns them."""
    axes.set_xlabel(x, fontsize=NORMAL, color=INK)
    axes.set_ylabel(y, fontsize=NORMAL, color=INK)
    if title:
        axes.set_title(title, fontsize=NORMAL + 1, color=INK, loc="left")
    axes.tick_params(labelsize=SMALL, colors=SOFT, length=3)
    axes.grid(visible=True, axis=grid, color=FAINT, linewidth=0.6)  # type: ignore[arg-type]
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(FAINT)
    return axes


def svg(figure: "Figure") -> str:
    """Return a figure as a data URI of an SVG picture."""
    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    text = out.getvalue()
    return (
        "data:image/svg+xml;base64,"
        + base64.b64encode(text[text.index("<svg") :].encode()).decode()
    )


def overlay(width: int, height: int) -> tuple["Figure", "Axes"]:
    """Return a clear figure whose axes are a picture's pixels, to be laid over it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / 100.0, height / 100.0), facecolor="none")
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.axis("off")
    return figure, axes


def read_picture(png: bytes) -> "NDArray[np.uint8]":
    """Return a PNG's pixels, (H, W) or (H, W, 3)."""
    from matplotlib.image import imread

    pixels = np.asarray(imread(io.BytesIO(png), format="png"))
    grey = np.asarray(np.rint(pixels * 255.0), dtype=np.uint8)
    return grey[..., :3] if grey.ndim == 3 else grey


def jpeg(picture: "NDArray[np.uint8]") -> str:
    """Return a picture as a data URI of a JPEG at most WIDEST_PICTURE px wide."""
    from matplotlib.image import imsave

    step = -(-picture.shape[1] // WIDEST_PICTURE)
    small = picture[::step, ::step]
    rgb = small if small.ndim == 3 else np.repeat(small[..., None], 3, axis=2)
    out = io.BytesIO()
    imsave(out, rgb, format="jpg", pil_kwargs={"quality": 88})
    return "data:image/jpeg;base64," + base64.b64encode(out.getvalue()).decode()


def haloed(width: float = 2.0) -> list[object]:
    """Return the effect that keeps a line or a word readable over any picture."""
    from matplotlib.patheffects import Normal, Stroke

    return [Stroke(linewidth=width + 1.6, foreground="white", alpha=0.75), Normal()]


def round_scale(largest: float, wanted: float) -> float:
    """Return the 1, 2 or 5 times a power of ten that brings `largest` up to `wanted` at most."""
    if not largest > 0.0:
        return 1.0
    raw = wanted / largest
    power = 10.0 ** np.floor(np.log10(raw))
    return float(power * max(s for s in (1, 2, 5) if s * power <= raw * (1 + 1e-9)))


def limits(values: Array, margin: float) -> tuple[float, float]:
    """Return the range of values with a margin on both sides."""
    return float(np.nanmin(values)) - margin, float(np.nanmax(values)) + margin
