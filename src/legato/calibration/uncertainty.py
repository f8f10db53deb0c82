"""What is not known of an estimate: covariance from the marks' noise and the camera's own.

Noise is the a-priori sigma of each mark: with seven marks and free intrinsics only four equations
are redundant, too few to learn it from. Only a misfit far out of the noise widens the result.
"""

import numpy as np

from legato.calibration.cost import PRIOR_GENES, Model, cost, in_camera
from legato.calibration.derivatives import place_derivative
from legato.calibration.problem import KnownIntrinsics, Problem, pose_of
from legato.geometry.transforms import Array, skew

# One misfit in a thousand is taken for noise.
NOISE_QUANTILE = 3.09


def observed_jacobian(points: Array, genes: Array) -> Array:
    """Return d pixel / d (alpha_u, alpha_v, u0, v0, rotation, translation) (K, 2, 10).

    `points` (K, 3) lie in the object frame, `genes` is (11,); rotation is a vector in the camera
    frame, multiplied from the left.
    """
    turned, c = in_camera(points, genes[None])
    depth = c[0, 2]
    x, y = c[0, 0] / depth, c[0, 1] / depth
    out = np.zeros((points.shape[0], 2, 10))
    out[:, 0, 0], out[:, 1, 1] = x, y
    out[:, 0, 2] = out[:, 1, 3] = 1.0
    by_place = place_derivative(genes[0] * genes[1], genes[0] * genes[2], x, y, depth)
    out[:, :, 4:7] = -by_place @ skew(turned[0].T)
    out[:, :, 7:] = by_place
    return out


def covariance_of(
    problem: Problem, model: Model, genes: Array, weights: Array | None = None
) -> Array:
    """Return the covariance (10, 10) of an optimum over alpha_u, alpha_v, u0, v0, rotation, place.

    Genes on a bound count as free. `weights` (M,) replace the model's; zero leaves a mark out.
    Rows of intrinsics that are exactly known are zero.
    """
    w = model.weights if weights is None else weights
    free = free_rows(model)
    j = observed_jacobian(model.points, genes) * (w / model.sigma)[:, None, None]
    j = j.reshape(-1, 10)[:, free]
    information = j.T @ j
    prior = np.zeros((10, 10))
    if model.prior is not None:
        prior[:4, :4] = model.prior[np.ix_(PRIOR_GENES, PRIOR_GENES)] / model.sigma**2
    part = prior[np.ix_(free, free)]
    inner = _inverse(information + part)
    if problem.known is not None:
        # The camera's own error enters through the prior, or unseen through what was held fixed.
        lens = _lens_jacobian(problem.known, model.points, genes)
        lens = (lens * (w / model.sigma)[:, None, None]).reshape(-1, 6)
        lens[:, [i for i in range(4) if i in free]] = 0.0
        pull = np.zeros((len(free), 6))
        pull[:, :4] = prior[free, :4]
        pull -= j.T @ lens
        # As a square of factors it stays positive, however little the marks tell.
        factor = inner @ np.hstack([j.T, pull @ _root(problem.known.covariance)])
        inner = factor @ factor.T
    out = np.zeros((10, 10))
    out[np.ix_(free, free)] = (inner + inner.T) / 2.0
    return out


def free_rows(model: Model) -> list[int]:
    """Return which of the ten observable parameters were estimated."""
    if model.box[1, 0] > model.box[0, 0]:
        return list(range(10))
    moved = model.box[1] > model.box[0]
    return [i for i in range(4) if moved[i + 1]] + list(range(4, 10))


def _lens_jacobian(known: KnownIntrinsics, points: Array, genes: Array) -> Array:
    """Return d pixel / d (alpha_u, alpha_v, u0, v0, k1, k2) (K, 2, 6)."""
    _, c = in_camera(points, genes[None])
    flat = (c[0, :2] / c[0, 2]).T
    r2 = np.sum(flat * flat, axis=1)
    i = known.intrinsics
    out = np.zeros((points.shape[0], 2, 6))
    out[:, 0, 0], out[:, 1, 1] = flat[:, 0], flat[:, 1]
    out[:, 0, 2] = out[:, 1, 3] = 1.0
    out[:, :, 4] = flat * [i.alpha_u, i.alpha_v] * r2[:, None]
    out[:, :, 5] = out[:, :, 4] * r2[:, None]
    return out


def _root(covariance: Array) -> Array:
    """Return a matrix (D, D) whose square is a covariance that need not have full rank."""
    values, vectors = np.linalg.eigh(np.asarray(covariance, dtype=float))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _inverse(matrix: Array) -> Array:
    """Return the inverse of an information matrix whose parameters differ in unit.

    Directions of which nothing is known get a variance that is huge, never a negative one.
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    inner = (vectors / np.maximum(values, 1e-14)) @ vectors.T
    return np.asarray(inner * np.outer(scale, scale))


def root_trace(covariance: Array) -> Array:
    """Return the root of the trace of covariances (..., D, D); infinite where rounding ate it."""
    trace = np.trace(covariance, axis1=-2, axis2=-1)
    return np.where(trace >= 0.0, np.sqrt(np.abs(trace)), np.inf)


def station_sigmas(covariance: Array, genes: Array, stations: Array) -> Array:
    """Return one standard deviation (S,) mm of each station's place in the camera frame."""
    if not len(stations):
        return np.zeros(0)
    turned = stations @ pose_of(genes)[:3, :3].T
    j = np.concatenate([-skew(turned), np.broadcast_to(np.eye(3), (len(stations), 3, 3))], axis=2)
    spread = j @ covariance[4:, 4:] @ np.swapaxes(j, 1, 2)
    return root_trace(spread)


def misfit(model: Model, genes: Array, weights: Array | None = None) -> tuple[float, int]:
    """Return chi-square of genes (11,) and its degrees of freedom."""
    w = model.weights if weights is None else weights
    value = float(cost(model, genes[None], w)[0]) / model.sigma**2
    given = 2 * int(np.count_nonzero(w)) + (0 if model.prior is None else len(free_rows(model)) - 6)
    return value, given - len(free_rows(model))


def noise_limit(freedom: int, quantile: float = NOISE_QUANTILE) -> float:
    """Return the chi-square that noise passes once in a thousand (Wilson and Hilferty)."""
    if freedom < 1:
        return 0.0
    share = 2.0 / (9.0 * freedom)
    return float(freedom * (1.0 - share + quantile * np.sqrt(share)) ** 3)


def widening(chi_square: float, freedom: int) -> float:
    """Return by what to multiply a covariance: 1 while the misfit may be noise."""
    if freedom < 1 or chi_square <= noise_limit(freedom):
        return 1.0
    return chi_square / freedom
