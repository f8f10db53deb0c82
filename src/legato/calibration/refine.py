"""Levenberg-Marquardt on many starts at once, inside the box, to zero gradient.

Bounds are an active set: within a step, genes that would pass a bound are put on it and the others
solved again, so that bounded optima are met as exactly as free ones.
"""

from dataclasses import dataclass

import numpy as np

from legato.calibration.cost import Flags, Indices, Model, tied
from legato.calibration.derivatives import normal_equations
from legato.calibration.operators import wrapped
from legato.geometry.transforms import Array

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-1, 1e-12, 1e12
# Converged: the full step would lower the cost by less than this share, or this many px^2.
RELATIVE_DECREASE, ABSOLUTE_DECREASE = 1e-13, 1e-22
# Optima are the same where their costs are: 1e-6 of the cost is far below one sigma of any gene.
SAME_COST, SAME_COST_PX2 = 1e-6, 1e-12


@dataclass(frozen=True)
class Refined:
    """Optima (B, 11) with costs (B,) px^2, whether each converged, and the rounds taken.

    `unfinished` are those that were broken off because enough others had met.
    """

    genes: Array
    cost: Array
    converged: Flags
    unfinished: Flags
    rounds: int

    def at_best(self) -> Flags:
        """Return which reached the best cost."""
        return same_cost(self.cost, float(self.cost.min()))


def same_cost(costs: Array, best: float) -> Flags:
    """Return which costs (B,) are the best one but for rounding."""
    return np.asarray(costs <= best * (1.0 + SAME_COST) + SAME_COST_PX2)


def refine(
    model: Model,
    starts: Array,
    weights: Array | None = None,
    rounds: int = 100,
    enough: int | None = None,
    ended: int = 0,
) -> Refined:
    """Return what Levenberg-Marquardt makes of starts (B, 11), each inside the model's box.

    `weights` (B, M) replace the model's, one row a start; a weight of zero leaves a mark out.
    Where `enough` is given, the rest is broken off once so many have converged to one cost that no
    other start is below, and at least `ended` have come to an end anywhere.
    """
    free = _span(model.refined)
    box = model.box[:, free]
    genes = np.clip(tied(model, starts), *model.box)
    w = np.broadcast_to(model.weights if weights is None else weights, (len(genes), _marks(model)))
    value, hessian, gradient = normal_equations(model, genes, w, free)
    damping = np.full(len(genes), FIRST_DAMPING)
    converged = np.zeros(len(genes), dtype=bool)
    going = np.flatnonzero(np.isfinite(value))
    taken = 0
    while going.size and taken < rounds:
        over = len(genes) - going.size
        if enough is not None and over >= ended and _met(value, converged) >= enough:
            break
        taken += 1
        now = genes[going]
        step, decrease = _step(now[:, free], box, hessian[going], gradient[going], damping[going])
        trial = now.copy()
        trial[:, free] += step
        found = normal_equations(model, trial, w[going], free)
        better = found[0] <= value[going]
        # Bounds can turn a step uphill: that proves nothing either, and damping mends it.
        small = np.abs(decrease) <= RELATIVE_DECREASE * value[going] + ABSOLUTE_DECREASE
        won = going[better]
        genes[won] = trial[better]
        value[won], hessian[won], gradient[won] = (part[better] for part in found)
        damping[going] = np.clip(
            damping[going] * np.where(better, 0.1, 5.0), LEAST_DAMPING, MOST_DAMPING
        )
        # A small step under heavy damping proves nothing; rounding may refuse the very last one.
        done = small & (damping[going] <= 1e-2)
        stuck = ~better & (damping[going] >= MOST_DAMPING)
        converged[going[done]] = True
        going = going[~(done | stuck)]
    unfinished = np.zeros(len(genes), dtype=bool)
    unfinished[going] = True
    return Refined(wrapped(genes, model.wrap), value, converged, unfinished, taken)


def _met(value: Array, converged: Flags) -> int:
    """Return how many have converged to the least of all costs."""
    return int(np.count_nonzero(converged & same_cost(value, float(value.min()))))


def _span(free: Indices) -> slice | Indices:
    """Return indices as a slice where they are neighbours: reading it copies nothing."""
    if free.size and free[-1] - free[0] + 1 == free.size:
        return slice(int(free[0]), int(free[-1]) + 1)
    return free


def _step(
    x: Array, box: Array, hessian: Array, gradient: Array, damping: Array
) -> tuple[Array, Array]:
    """Return damped steps (B, R) that stay in the box (2, R), and the decrease they predict."""
    low, high = box
    held = ((x <= low) & (gradient > 0.0)) | ((x >= high) & (gradient < 0.0))
    fixed = np.zeros_like(x)
    diagonal = np.einsum("bii->bi", hessian)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = hessian * scale[:, :, None] * scale[:, None, :]
    np.einsum("bii->bi", scaled)[...] += damping[:, None]
    pull = gradient * scale
    for _ in range(x.shape[1]):
        step = _solve_held(scaled, pull, held, fixed / scale) * scale
        over = ((x + step > high) | (x + step < low)) & ~held
        if not over.any():
            break
        fixed = np.where(over, np.clip(x + step, low, high) - x, fixed)
        held |= over
    step = np.clip(x + step, low, high) - x
    curved = (hessian @ step[..., None])[..., 0]
    return step, -np.sum(step * (2.0 * gradient + curved), axis=1)


def _solve_held(matrix: Array, gradient: Array, held: Flags, fixed: Array) -> Array:
    """Return the minimum (B, R) of the quadratic where `held` unknowns take the `fixed` values."""
    if not held.any():
        return np.asarray(np.linalg.solve(matrix, -gradient[..., None])[..., 0])
    right = -gradient - (matrix @ np.where(held, fixed, 0.0)[..., None])[..., 0]
    right = np.where(held, fixed, right)
    both = held[:, :, None] | held[:, None, :]
    a = np.where(both, np.eye(held.shape[1]), matrix)
    return np.asarray(np.linalg.solve(a, right[..., None])[..., 0])


def _marks(model: Model) -> int:
    return len(model.points)
