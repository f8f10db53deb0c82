"""Marks to a few hundredths of a pixel: a mark's template laid over the picture by least squares.

Gauss-Newton over shift, turn and blur; light (a plane), contrast (a plane) and the surroundings'
tone are linear and solved along. The dark diagonal comes out as the sign of the contrast.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from legato.geometry.leg import Leg
from legato.geometry.transforms import Array
from legato.vision.picture import Grey
from legato.vision.template import BLUR_STEP, Plane, Template, make_template
from legato.vision.view import View

ROUNDS = 8
COARSE = 0.05  # px
CONVERGED = 0.01  # px
FARTHEST = 8.0  # px from the start to a mark
COVERED = 0.65  # share of a pixel that must be paper, lest the wood's figure counts
# What the residuals do not show, measured on rendered pictures: a factor on their sigma, a floor
# in px, and what a blur (px, squared) mixes in from around the mark.
SPREAD_FACTOR, FLOOR, FLOOR_PER_BLUR = 1.1, 0.004, 0.005
FIRST_TURNS = np.radians([-9.0, 0.0, 9.0])
SMALL = 2600  # pixels of a patch below which three rays a pixel are worth their time
TURN_STEP = np.radians(1.0)
TURN_SIGMA = np.radians(15.0)
LARGEST_TURN = np.radians(20.0)
BLUR_SIGMA = 0.7  # px
BLURS = (0.35, 5.0)  # px
LEAST_PIXELS = 40
LEAST_CONTRAST = 4.0  # grey levels from the mean to white or black
LARGEST_MISFIT = 0.05  # share of the patch's variance that neither template nor noise explains
COARSE_MISFIT = 0.3  # the same, while the view is still wrong
LARGEST_SIGMA = 0.3  # px


class NotThere(Exception):
    """A mark's template does not fit the picture where the mark should be."""


@dataclass(frozen=True)
class Refined:
    """A mark's centre (2,) and its sigma in px, and how it was pasted and imaged."""

    pixel: Array
    sigma: float
    turn: float
    parity: int
    blur: float
    contrast: float


@dataclass(frozen=True)
class _State:
    """What Gauss-Newton moves: shift (2,) px, turn rad, blur px."""

    shift: Array
    turn: float
    blur: float


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
    states = [_State(start, float(turn), 1.0) for turn in FIRST_TURNS]
    state = min(states, key=lambda s: _Overlay.of(template, patch, s).misfit(0.0))
    return _fitted(template, patch, centre, state, noise, COARSE)


def polish_mark(
    image: Grey, leg: Leg, view: View, name: str, noise: float, refined: Refined
) -> Refined:
    """Return a refined mark again, now at a better view and to a hundredth of a pixel."""
    template, patch, centre = _prepared(image, leg, view, name, 1)
    if patch.size < SMALL:
        template, patch, centre = _prepared(image, leg, view, name, 3)
    state = _State(refined.pixel - centre, refined.turn, refined.blur)
    return _fitted(template, patch, centre, state, noise, CONVERGED)


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
    template: Template, patch: Array, centre: Array, start: _State, noise: float, close: float
) -> Refined:
    """Return the mark after Gauss-Newton rounds until its centre moves less than `close` px."""
    state, moved = start, np.inf
    for _ in range(ROUNDS):
        overlay = _Overlay.of(template, patch, state)
        normal, gradient = _normal(template, overlay, state)
        state, moved = _stepped(state, normal, gradient)
        if moved < close:
            break
    if abs(overlay.contrast) < LEAST_CONTRAST:
        raise NotThere("hidden or too dark")
    if overlay.misfit(noise) > (LARGEST_MISFIT if close == CONVERGED else COARSE_MISFIT):
        raise NotThere("hidden in part, or not a mark")
    if moved > 0.1 or np.linalg.norm(state.shift - start.shift) > FARTHEST:
        raise NotThere("no clear mark at its place")
    spread = overlay.spread(normal)
    if spread > LARGEST_SIGMA:
        raise NotThere("hidden or too dark")
    floor = FLOOR + FLOOR_PER_BLUR * state.blur**2
    return Refined(
        centre + state.shift,
        float(np.sqrt((SPREAD_FACTOR * spread) ** 2 + floor**2)),
        state.turn,
        1 if overlay.contrast > 0 else -1,
        state.blur,
        abs(overlay.contrast),
    )


@dataclass(frozen=True)
class _Overlay:
    """The template laid over the patch at a state, its linear part solved.

    `use` (h, w) are the pixels that count, P of them; `linear` (P, 7) and `gains` (7,) the linear
    part; `gain` (P,) the contrast at each pixel; `noise` the residuals' robust spread.
    """

    sharp: Plane
    sign: Plane
    use: NDArray[np.bool_]
    linear: Array
    gains: Array
    gain: Array
    residual: Array
    weight: Array
    noise: float
    seen: Array

    @classmethod
    def of(cls, t: Template, patch: Array, state: _State) -> "_Overlay":
        """Lay the template over the patch and solve for light, contrast and surroundings."""
        sharp, inside = t.pattern(state.shift, state.turn)
        covered = t.seen(inside, state.blur)
        use = covered > COVERED
        if use.sum() < LEAST_PIXELS:
            raise NotThere("too small in the picture")
        sign = t.seen(sharp, state.blur)
        h, w = t.shape
        x = np.broadcast_to(np.linspace(-1.0, 1.0, w), (h, w))[use]
        y = np.broadcast_to(np.linspace(-1.0, 1.0, h)[:, None], (h, w))[use]
        s = sign[use].astype(float)
        linear = np.stack([np.ones_like(x), x, y, s, x * s, y * s, 1.0 - covered[use]], axis=-1)
        seen = patch[use]
        weight = np.ones_like(seen)
        for _ in range(2):
            weighted = linear * weight[:, None]
            gains = np.linalg.solve(weighted.T @ linear + 1e-6 * np.eye(7), weighted.T @ seen)
            residual = seen - linear @ gains
            noise = max(1.48 * float(np.median(np.abs(residual))), 0.5)
            # A glare or a cover over a part of the mark must not drag the rest.
            weight = np.minimum(1.0, 3.0 * noise / np.maximum(np.abs(residual), 1e-9))
        gain = gains[3] + gains[4] * x + gains[5] * y
        return cls(sharp, sign, use, linear, gains, gain, residual, weight, noise, seen)

    @property
    def contrast(self) -> float:
        """Half the difference between white and black in grey levels, signed by the diagonal."""
        return float(self.gains[3])

    def misfit(self, noise: float) -> float:
        """Return the share of the patch's variance that template and `noise` leave over.

        Not weighted: a mark that is partly covered must not pass for a whole one.
        """
        return float((self.residual.var() - noise**2) / max(float(self.seen.var()), 1e-9))

    def spread(self, normal: Array) -> float:
        """Return the centre's sigma in px that the residuals and the normal matrix imply."""
        freedom = max(1.0, float(self.weight.sum()) - normal.shape[0])
        # Rounding to whole grey levels alone has a variance of 1/12.
        variance = max(float((self.weight * self.residual**2).sum()) / freedom, 0.083)
        covariance = np.linalg.pinv(normal, hermitian=True)[:2, :2]
        return float(np.sqrt(np.trace(covariance) / 2.0 * variance))


def _normal(t: Template, o: _Overlay, state: _State) -> tuple[Array, Array]:
    """Return normal matrix (11, 11) and gradient (11,) over shift, turn, blur and linear part."""
    turned, _ = t.pattern(state.shift, state.turn + TURN_STEP)
    wider = t.seen(o.sharp, state.blur * (1.0 + BLUR_STEP))
    by_row, by_column = np.gradient(o.sign, axis=0), np.gradient(o.sign, axis=1)
    by_turn = (t.seen(turned, state.blur) - o.sign) / TURN_STEP
    by_blur = (wider - o.sign) / (state.blur * BLUR_STEP)
    slopes = (-by_column, -by_row, by_turn, by_blur)
    moving = np.stack([o.gain * slope[o.use] for slope in slopes], axis=-1)
    full = np.concatenate([moving, o.linear], axis=1)
    weighted = full * o.weight[:, None]
    normal = weighted.T @ full
    # The blur is known to lie near a pixel, and a turn is small: weak priors.
    normal[2, 2] += (o.noise / TURN_SIGMA) ** 2
    normal[3, 3] += (o.noise / BLUR_SIGMA) ** 2
    return normal, weighted.T @ o.residual


def _stepped(state: _State, normal: Array, gradient: Array) -> tuple[_State, float]:
    """Return the state after one Gauss-Newton step, and how far the mark moved in px."""
    step = np.linalg.pinv(normal, hermitian=True) @ gradient
    move = np.clip(step[:2], -1.5, 1.5)
    turn = float(np.clip(state.turn + np.clip(step[2], -0.15, 0.15), -LARGEST_TURN, LARGEST_TURN))
    blur = float(np.clip(state.blur + np.clip(step[3], -0.3, 0.3), *BLURS))
    # A turn counts by what it moves at some 15 px from the centre.
    moved = max(float(np.linalg.norm(move)), 15.0 * abs(turn - state.turn))
    return _State(state.shift + move, turn, blur), moved
