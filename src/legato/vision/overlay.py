"""A template laid over a patch of the picture: what it explains, what it leaves, how to better it.

Light (a plane), contrast (a plane) and the surroundings' tone are linear and solved along; shift,
turn and blur have derivatives. The dark diagonal comes out as the sign of the contrast.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from legato.geometry.transforms import Array
from legato.vision.template import BLUR_STEP, Plane, Template, difference

COVERED = 0.65  # share of a pixel that must be paper, lest the wood's figure counts
PARTS = 3  # a patch is tested by so many parts along each side
TURN_STEP = np.radians(1.0)
TURN_SIGMA = np.radians(15.0)
BLUR_SIGMA = 0.7  # px
LEAST_PIXELS = 40
CLIPPED = (0.5, 254.5)  # grey levels: what lies beyond was cut off by the sensor
LOPSIDED = 0.4  # share by which the clipping of opposite quarters may differ


class NotThere(Exception):
    """A mark's template does not fit the picture where the mark should be."""


@dataclass(frozen=True)
class State:
    """What Gauss-Newton moves: shift (2,) px, turn rad, blur px."""

    shift: Array
    turn: float
    blur: float


def unclipped(patch: Array) -> NDArray[np.bool_]:
    """Say which pixels hold a level between black and white."""
    return np.asarray((patch > CLIPPED[0]) & (patch < CLIPPED[1]))


@dataclass(frozen=True)
class Overlay:
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
    lopsided: bool

    @classmethod
    def of(cls, t: Template, patch: Array, state: State) -> "Overlay":
        """Lay the template over the patch and solve for light, contrast and surroundings."""
        sharp, inside = t.pattern(state.shift, state.turn)
        covered = t.seen(inside, state.blur)
        use = covered > COVERED
        if use.sum() < LEAST_PIXELS:
            raise NotThere("too small in the picture")
        # A clipped pixel says only that it was brighter or darker than it shows.
        covered_pixels, use = use, use & unclipped(patch)
        if use.sum() < LEAST_PIXELS:
            raise NotThere("too bright or too dark")
        sign = t.seen(sharp, state.blur)
        h, w = t.shape
        v, u = np.nonzero(use)
        x, y, s = u * (2.0 / (w - 1)) - 1.0, v * (2.0 / (h - 1)) - 1.0, sign[use].astype(float)
        linear = np.empty((len(u), 7))
        for k, column in enumerate((1.0, x, y, s, x * s, y * s, 1.0 - covered[use])):
            linear[:, k] = column
        seen = patch[use]
        weight = np.ones(len(seen))
        for _ in range(2):
            weighted = linear * weight[:, None]
            inner = weighted.T @ linear + 1e-6 * np.eye(7)
            gains = np.asarray(np.linalg.solve(inner, weighted.T @ seen), dtype=float)
            residual = seen - linear @ gains
            noise = max(1.48 * upper_median(np.abs(residual)), 0.5)
            # A glare or a cover over a part of the mark must not drag the rest.
            weight = np.asarray(
                np.minimum(1.0, 3.0 * noise / np.maximum(np.abs(residual), 1e-9)), dtype=float
            )
        gain = gains[3] + gains[4] * x + gains[5] * y
        uneven = _uneven(covered_pixels, use)
        return cls(sharp, sign, use, linear, gains, gain, residual, weight, noise, seen, uneven)

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
        covariance = np.linalg.inv(ridged(normal))[:2, :2]
        return float(np.sqrt(np.trace(covariance) / 2.0 * variance))

    def disunity(self, full: Array, normal: Array) -> float:
        """Return the centre's sigma in px by leaving out each of the patch's parts in turn.

        A glare or a shadow over one part pulls there alone: the residuals' size does not tell, the
        parts' disagreement does.
        """
        v, u = np.nonzero(self.use)
        h, w = self.use.shape
        part = np.minimum(PARTS * v // h, PARTS - 1) * PARTS + np.minimum(PARTS * u // w, PARTS - 1)
        weighted = full * self.weight[:, None]
        shifts = []
        for k in range(PARTS * PARTS):
            here = part == k
            if not here.any():
                continue
            less = normal - weighted[here].T @ full[here]
            rest = -(weighted[here].T @ self.residual[here])
            # At the optimum the whole gradient is nought: what is left is the part's, reversed.
            shifts.append(np.linalg.solve(ridged(less), rest)[:2])
        away = np.array(shifts)
        spread = (len(away) - 1) / len(away) * ((away - away.mean(axis=0)) ** 2).sum()
        return float(np.sqrt(spread / 2.0))


def derivatives(t: Template, o: Overlay, state: State) -> tuple[Array, Array, Array]:
    """Return derivatives (P, 11), normal matrix and gradient by shift, turn, blur, linear part."""
    turned, _ = t.pattern(state.shift, state.turn + TURN_STEP)
    wider = t.seen(o.sharp, state.blur * (1.0 + BLUR_STEP))
    by_row, by_column = difference(o.sign, 0), difference(o.sign, 1)
    by_turn = (t.seen(turned, state.blur) - o.sign) / TURN_STEP
    by_blur = (wider - o.sign) / (state.blur * BLUR_STEP)
    slopes = (-by_column, -by_row, by_turn, by_blur)
    full = np.empty((len(o.linear), 11))
    for k, slope in enumerate(slopes):
        full[:, k] = o.gain * slope[o.use]
    full[:, 4:] = o.linear
    weighted = full * o.weight[:, None]
    normal = weighted.T @ full
    # The blur is known to lie near a pixel, and a turn is small: weak priors.
    normal[2, 2] += (o.noise / TURN_SIGMA) ** 2
    normal[3, 3] += (o.noise / BLUR_SIGMA) ** 2
    return full, normal, weighted.T @ o.residual


def _uneven(covered: NDArray[np.bool_], use: NDArray[np.bool_]) -> bool:
    """Say whether a mark is clipped on one side more than on the other.

    Too long an exposure clips both white quarters alike; a glare lies over one of them, and what
    it leaves of the edges runs where the glare ends.
    """
    if use.sum() == covered.sum():
        return False
    v, u = np.nonzero(covered)
    low, left = v < v.mean(), u < u.mean()
    kept = use[covered]
    shares = [
        float(kept[a & b].mean()) if (a & b).any() else 0.0
        for a, b in ((low, left), (~low, ~left), (low, ~left), (~low, left))
    ]
    return bool(max(abs(shares[0] - shares[1]), abs(shares[2] - shares[3])) > LOPSIDED)


def ridged(normal: Array) -> Array:
    """Return a normal matrix that can be inverted whatever the picture shows."""
    return normal + np.diag(1e-10 * np.diag(normal) + 1e-12)


def upper_median(values: Array) -> float:
    """Return the upper median, without the care that NaN would need."""
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])
