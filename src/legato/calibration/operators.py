"""The paper's genetic operators (sections 3.2 and 3.3, as corrected), over whole populations.

Every operator takes a Generator where it draws, and never leaves the box. Genes that wrap differ by
the shorter way round, so that 179 and -179 deg are neighbours.
"""

import numpy as np

from legato.calibration.cost import Flags, Indices
from legato.geometry.transforms import Array

TURN = 2.0 * np.pi


def random_population(rng: np.random.Generator, size: int, box: Array) -> Array:
    """Return genes (size, G) drawn evenly from the box (2, G)."""
    return rng.uniform(box[0], box[1], (size, box.shape[1]))


def ranking(size: int, pressure: float) -> Array:
    """Return the probability (size,) of choosing each rank, best first: linear, summing to one."""
    rank = np.arange(size)
    if size == 1:
        return np.ones(1)
    slope = 2.0 * (pressure - 1.0) / (size * (size - 1.0))
    return np.asarray((2.0 - pressure) / size + slope * (size - 1.0 - rank))


def roulette(rng: np.random.Generator, probabilities: Array, count: int) -> Indices:
    """Return `count` indices, each drawn with its probability."""
    wheel = np.cumsum(probabilities)
    drawn = np.searchsorted(wheel, rng.random(count) * wheel[-1], side="right")
    return np.asarray(np.minimum(drawn, len(wheel) - 1))


def difference(a: Array, b: Array, wrap: Flags) -> Array:
    """Return b - a (..., G), the shorter way round for genes that wrap."""
    return _wrap(b - a, wrap)


def wrapped(genes: Array, wrap: Flags) -> Array:
    """Return genes (..., G) with those that wrap brought into [-pi, pi)."""
    return _wrap(genes.copy(), wrap)


def _wrap(values: Array, wrap: Flags) -> Array:
    """Bring the columns that wrap into [-pi, pi), in place."""
    if wrap.any():
        turning = values[..., wrap]
        values[..., wrap] = turning - TURN * np.floor((turning + np.pi) / TURN)
    return values


def crossover(
    rng: np.random.Generator, parents: Array, costs: Array, rate: float, wrap: Flags
) -> Array:
    """Return children (N, G) of neighbouring parents (0, 1), (2, 3), ... with costs (N,).

    Each of a pair moves toward the other by alpha rho, alpha uniform in [0, 1) and rho the bias:
    own cost over the other's, at most 1. So the worse parent moves further toward the better.
    """
    pairs = len(parents) // 2
    first, second = parents[: 2 * pairs : 2], parents[1 : 2 * pairs : 2]
    cost_1, cost_2 = costs[: 2 * pairs : 2], costs[1 : 2 * pairs : 2]
    alpha = rng.random(pairs) * (rng.random(pairs) < rate)
    toward = difference(first, second, wrap)
    children = parents.copy()
    children[: 2 * pairs : 2] += (alpha * bias(cost_1, cost_2))[:, None] * toward
    children[1 : 2 * pairs : 2] -= (alpha * bias(cost_2, cost_1))[:, None] * toward
    return _wrap(children, wrap)


def bias(own: Array, other: Array) -> Array:
    """Return how far to move toward the other, 0 to 1: the cost ratio own / other, at most 1."""
    better = own < other
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(better, own / other, 1.0))


def mutation(
    rng: np.random.Generator,
    genes: Array,
    box: Array,
    progress: float,
    rate: float,
    scale: float = 1.0,
    horizon: float = 1.0,
) -> Array:
    """Return genes (N, G), each moved with probability `rate` toward one of its bounds.

    The step is c (q+ - q)(1 - r^(1 - t / (a T))) upward or likewise downward by the toss of a coin,
    where `progress` is t / T, `scale` c and `horizon` a: large at first, vanishing at the end.
    What passes a bound is set on it.
    """
    mutants = genes.copy()
    chosen = np.flatnonzero(rng.random(genes.size) < rate)
    gene = chosen % genes.shape[1]
    old = genes.reshape(-1)[chosen]
    share = 1.0 - rng.random(len(chosen)) ** max(0.0, 1.0 - progress / horizon)
    target = box[(rng.random(len(chosen)) < 0.5).astype(int), gene]
    moved = old + scale * share * (target - old)
    mutants.reshape(-1)[chosen] = np.clip(moved, box[0, gene], box[1, gene])
    return mutants
