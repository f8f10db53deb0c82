"""How large a mark is against its template: the one length that the leg's own size does not set.

A leg of another size seen from farther off looks the same, but marks come from a printer. The
outline is laid over the picture together with the wood around it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from legato.geometry.transforms import Array
from legato.vision.overlay import ridged, upper_median
from legato.vision.template import BLUR_STEP, Plane, Template, difference

RIM = 2.5  # blurs beside the outline that are looked at
LEAST_PIXELS = 60
TURN_STEP, SIZE_STEP = np.radians(1.0), 0.02
LINEAR = 0.005  # from a size wrong by more the step is taken again
MOST_ROUNDS = 4
# The wood's figure runs along an edge for many pixels: measured on rendered pictures, errors are so
# many times what independent pixels would give.
SPREAD_FACTOR = 7.0


@dataclass(frozen=True)
class Size:
    """A mark's side over that of its template, and its standard deviation."""

    ratio: float
    sigma: float


UNKNOWN = Size(1.0, float("inf"))


@dataclass(frozen=True)
class _State:
    """What moves: shift (2,) px, turn rad, blur px, and the side over the template's."""

    shift: Array
    turn: float
    blur: float
    ratio: float

    def stepped(self, step: Array) -> "_State":
        """Return the state after a step, kept where a template means something."""
        return _State(
            self.shift + step[:2],
            self.turn + float(step[2]),
            float(np.clip(self.blur + step[3], 0.35, 6.0)),
            float(np.clip(self.ratio + step[4], 0.8, 1.25)),
        )


def measure_size(
    template: Template,
    patch: Array,
    valid: NDArray[np.bool_],
    shift: Array,
    turn: float,
    blur: float,
) -> Size:
    """Return a mark's size where its centre, turn and blur are known already.

    `valid` (h, w) are the pixels that are not clipped. UNKNOWN where too little of the outline and
    of the wood around it is in sight.
    """
    state = _State(np.asarray(shift, dtype=float), turn, blur, 1.0)
    on = (template.seen(template.surface, max(blur, 1.0)) > 0.995) & valid
    sigma = float("inf")
    for _ in range(MOST_ROUNDS):
        found = _step(template, patch, on, state)
        if found is None:
            return UNKNOWN
        step, sigma = found
        state = state.stepped(step)
        if abs(step[4]) < LINEAR:
            break
    return Size(state.ratio, sigma)


def _step(
    t: Template, patch: Array, on: NDArray[np.bool_], state: _State
) -> tuple[Array, float] | None:
    """Return one Gauss-Newton step (5,) and the ratio's standard deviation; None for too little."""
    sharp, inside = t.scaled(state.ratio).pattern(state.shift, state.turn)
    sign, cover = t.seen(sharp, state.blur), t.seen(inside, state.blur)
    use = on & _near(t, state)
    if use.sum() < LEAST_PIXELS:
        return None
    x, y = _planes(t.shape)
    wood = 1.0 - cover
    columns = (cover, cover * x, cover * y, sign, x * sign, y * sign, wood, wood * x, wood * y)
    linear = np.stack(columns, axis=-1)[use].astype(float)
    seen = patch[use]
    gains = np.linalg.solve(linear.T @ linear + 1e-6 * np.eye(9), linear.T @ seen)
    residual = seen - linear @ gains
    rise = (gains[0] - gains[6]) + (gains[1] - gains[7]) * x + (gains[2] - gains[8]) * y
    gain = gains[3] + gains[4] * x + gains[5] * y
    moving = [slope[use] for slope in _slopes(t, state, sharp, inside, rise, gain)]
    full = np.concatenate([np.stack(moving, axis=-1), linear], axis=1)
    noise = max(1.48 * upper_median(np.abs(residual)), 0.5)
    weight = np.minimum(1.0, 3.0 * noise / np.maximum(np.abs(residual), 1e-9))
    weighted = full * weight[:, None]
    inverse = np.linalg.inv(ridged(weighted.T @ full))
    freedom = max(1.0, float(weight.sum()) - full.shape[1])
    variance = max(float((weight * residual**2).sum()) / freedom, 0.083)
    sigma = SPREAD_FACTOR * float(np.sqrt(max(inverse[4, 4], 0.0) * variance))
    return np.asarray((inverse @ (weighted.T @ residual))[:5]), sigma


def _slopes(
    t: Template, state: _State, sharp: Plane, inside: Plane, rise: Array, gain: Array
) -> tuple[Plane, ...]:
    """Return the picture's derivatives by shift (two), turn, blur and size, each (h, w)."""
    square = np.ones((t.fine, t.fine))
    fine_rise, fine_gain = (np.kron(p, square).astype(np.float32) for p in (rise, gain))

    def seen(sharp: Plane, inside: Plane, blur: float) -> Plane:
        return t.seen(fine_rise * inside + fine_gain * sharp, blur)

    here = seen(sharp, inside, state.blur)
    turned = t.scaled(state.ratio).pattern(state.shift, state.turn + TURN_STEP)
    larger = t.scaled(state.ratio + SIZE_STEP).pattern(state.shift, state.turn)
    return (
        -difference(here, 1),
        -difference(here, 0),
        (seen(*turned, state.blur) - here) / np.float32(TURN_STEP),
        (seen(sharp, inside, state.blur * (1.0 + BLUR_STEP)) - here)
        / np.float32(state.blur * BLUR_STEP),
        (seen(*larger, state.blur) - here) / np.float32(SIZE_STEP),
    )


def _near(t: Template, state: _State) -> NDArray[np.bool_]:
    """Say (h, w) which pixels lie on the mark or on the rim around it."""
    middle = t.slopes[0].shape[0] // 2, t.slopes[0].shape[1] // 2
    per_mm = 1.0 / float(np.hypot(t.slopes[0][middle], t.slopes[1][middle])) / t.fine
    ratio = state.ratio + RIM * state.blur / (t.half * per_mm)
    _, inside = t.scaled(ratio).pattern(state.shift, state.turn)
    return np.asarray(t.seen(inside, 0.5) > 0.5)


def _planes(shape: tuple[int, int]) -> tuple[Array, Array]:
    """Return the coordinates of a patch's pixels, -1 to 1."""
    h, w = shape
    x = np.broadcast_to(np.linspace(-1.0, 1.0, w), (h, w))
    return x, np.broadcast_to(np.linspace(-1.0, 1.0, h)[:, None], (h, w))
