"""Marks to a few hundredths of a pixel: each template moved until it lies on the picture.

First roughly, while the view is still wrong, then to a hundredth of a pixel, with the mark's size.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from legato.geometry.leg import Leg
from legato.geometry.transforms import Array
from legato.vision.overlay import NotThere, Overlay, State, derivatives, ridged, unclipped
from legato.vision.picture import Grey
from legato.vision.size import UNKNOWN, Size, measure_size
from legato.vision.template import Template, make_template
from legato.vision.view import View

ROUNDS = 8
COARSE = 0.05  # px
CONVERGED = 0.01  # px
FARTHEST = 8.0  # px from the start to a mark
# What the residuals do not show, measured on rendered pictures: a factor on their sigma, a floor
# in px, and what a blur (px, squared) mixes in from around the mark.
SPREAD_FACTOR, FLOOR, FLOOR_PER_BLUR = 1.1, 0.004, 0.005
FIRST_TURNS = np.radians([-9.0, 9.0])  # where none at all leads nowhere
PARTS_FACTOR = 0.8  # parts without an edge tell little: measured on rendered pictures
SMALL = 2600  # pixels of a patch below which three rays a pixel are worth their time
LARGEST_TURN = np.radians(20.0)
BLURS = (0.35, 5.0)  # px
LEAST_CONTRAST = 4.0  # grey levels from the mean to white or black
LARGEST_MISFIT = 0.05  # share of the patch's variance that neither template nor noise explains
COARSE_MISFIT = 0.3  # the same, while the view is still wrong
LARGEST_SIGMA = 0.3  # px


@dataclass(frozen=True)
class Refined:
    """A mark's centre (2,) and its sigma in px, and how it was pasted and imaged."""

    pixel: Array
    sigma: float
    turn: float
    parity: int
    blur: float
    contrast: float
    size: Size = UNKNOWN


def noise_of(image: Grey) -> float:
    """Return the standard deviation of a picture's pixel noise in grey levels, edges left aside."""
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
    detail = np.abs(cv2.filter2D(np.asarray(image, dtype=np.float32), cv2.CV_32F, kernel))
    return float(1.4826 * np.median(detail) / 6.0)


def refine_mark(
    image: Grey, leg: Leg, view: View, name: str, noise: float, near: Array | None = None
) -> Refined:
    """Return where a mark lies in the picture to a few tenths, turn and blur found on the way.

    Starts at the view's prediction or `near` (2,); `view` may be wrong by a degree and a few mm.
    `noise` is the picture's, in grey levels (`noise_of`).
    Raises NotThere with a reason where the mark is hidden, too dark, or something else.
    """
    template, patch, centre = _prepared(image, leg, view, name, 1)
    start = np.zeros(2) if near is None else near - centre
    try:
        return _fitted(template, patch, centre, State(start, 0.0, 1.0), noise, COARSE)
    except NotThere:
        states = [State(start, float(turn), 1.0) for turn in FIRST_TURNS]
        state = min(states, key=lambda s: Overlay.of(template, patch, s).misfit(0.0))
        return _fitted(template, patch, centre, state, noise, COARSE)


def polish_mark(
    image: Grey, leg: Leg, view: View, name: str, noise: float, refined: Refined
) -> Refined:
    """Return a refined mark again, now at a better view and to a hundredth of a pixel."""
    template, patch, centre = _prepared(image, leg, view, name, 1)
    if patch.size < SMALL:
        template, patch, centre = _prepared(image, leg, view, name, 3)
    state = State(refined.pixel - centre, refined.turn, refined.blur)
    polished = _fitted(template, patch, centre, state, noise, CONVERGED)
    at = polished.pixel - centre
    size = measure_size(template, patch, unclipped(patch), at, polished.turn, polished.blur)
    return replace(polished, size=size)


def _prepared(
    image: Grey, leg: Leg, view: View, name: str, fine: int
) -> tuple[Template, Array, Array]:
    """Return a mark's template, its patch of the picture and its predicted centre."""
    template = make_template(leg, view, name, fine)
    if template is None:
        raise NotThere("outside the picture")
    u, v = template.corner
    h, w = template.shape
    patch = image[v : v + h, u : u + w].astype(float)
    return template, patch, view.pixels(leg.points((name,)))[0]


def _fitted(
    template: Template, patch: Array, centre: Array, start: State, noise: float, close: float
) -> Refined:
    """Return the mark after Gauss-Newton rounds until its centre moves less than `close` px."""
    state, moved = start, np.inf
    for _ in range(ROUNDS):
        overlay = Overlay.of(template, patch, state)
        full, normal, gradient = derivatives(template, overlay, state)
        state, moved = _stepped(state, normal, gradient)
        if moved < close:
            break
    if abs(overlay.contrast) < LEAST_CONTRAST:
        raise NotThere("hidden or too dark")
    if overlay.misfit(noise) > (LARGEST_MISFIT if close == CONVERGED else COARSE_MISFIT):
        raise NotThere("hidden in part, or not a mark")
    if overlay.lopsided:
        raise NotThere("too bright or too dark in part")
    if moved > 0.1 or np.linalg.norm(state.shift - start.shift) > FARTHEST:
        raise NotThere("no clear mark at its place")
    spread = SPREAD_FACTOR * overlay.spread(normal)
    if close == CONVERGED:
        spread = max(spread, PARTS_FACTOR * overlay.disunity(full, normal))
    if spread > LARGEST_SIGMA:
        raise NotThere("hidden or too dark")
    floor = FLOOR + FLOOR_PER_BLUR * state.blur**2
    return Refined(
        centre + state.shift,
        float(np.hypot(spread, floor)),
        state.turn,
        1 if overlay.contrast > 0 else -1,
        state.blur,
        abs(overlay.contrast),
    )


def _stepped(state: State, normal: Array, gradient: Array) -> tuple[State, float]:
    """Return the state after one Gauss-Newton step, and how far the mark moved in px."""
    step = np.linalg.solve(ridged(normal), gradient)
    move = np.clip(step[:2], -1.5, 1.5)
    turn = float(np.clip(state.turn + np.clip(step[2], -0.15, 0.15), -LARGEST_TURN, LARGEST_TURN))
    blur = float(np.clip(state.blur + np.clip(step[3], -0.3, 0.3), *BLURS))
    # A turn counts by what it moves at some 15 px from the centre.
    moved = max(float(np.linalg.norm(move)), 15.0 * abs(turn - state.turn))
    return State(state.shift + move, turn, blur), moved
