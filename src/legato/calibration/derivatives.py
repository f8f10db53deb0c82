"""Derivatives of the projection, for whole batches of genes at once.

Layout: genes before coordinates before marks, so that every row written is contiguous and the
normal equations are one product. The public functions speak of (M, 2) pixels all the same.
"""

import numpy as np

from legato.calibration.cost import ANGLES, Indices, Model, in_camera
from legato.calibration.problem import GENES
from legato.geometry.transforms import Array


def jacobian(model: Model, genes: Array) -> tuple[Array, Array]:
    """Return residuals (N, M, 2) px and their derivatives (N, M, 2, 11), with no weights."""
    off, rows, _ = _rows(model, genes, None)
    return np.swapaxes(off, 1, 2), np.moveaxis(rows, (1, 2, 3), (3, 2, 1))


def normal_equations(
    model: Model, genes: Array, weights: Array, free: slice | Indices | None = None
) -> tuple[Array, Array, Array]:
    """Return cost (N,) px^2, J^T W J (N, R, R) and J^T W r (N, R), prior included.

    `weights` are (N, M); `free` says which R genes to derive for, the model's refined ones by
    default. The cost is infinite where a mark that counts lies behind the camera.
    """
    if free is None:
        free = model.refined
    off, rows, behind = _rows(model, genes, weights)
    n = len(genes)
    off *= weights[:, None]
    flat = rows[:, free]
    flat = (flat * weights[:, None, None]).reshape(n, flat.shape[1], -1)
    right = off.reshape(n, -1, 1)
    value = np.sum(right * right, axis=(1, 2))
    hessian, gradient = flat @ np.swapaxes(flat, 1, 2), (flat @ right)[..., 0]
    if model.prior is not None:
        apart = genes - model.mean
        pull = apart @ model.prior
        value += np.sum(apart * pull, axis=1)
        gradient += pull[:, free]
        hessian += model.prior[free][:, free]
    value[behind | np.isnan(value)] = np.inf
    return value, hessian, gradient


def _rows(model: Model, genes: Array, weights: Array | None) -> tuple[Array, Array, Array]:
    """Return residuals (N, 2, M), derivatives (N, 11, 2, M) and who has a mark behind (N,)."""
    turned, c = in_camera(model.points, genes)
    n, m = len(genes), len(model.points)
    depth = c[:, 2]
    if weights is None or weights.all():
        behind = np.any(depth <= 0.0, axis=1)
    else:
        # A mark that weighs nothing may lie anywhere, but must not make a number infinite.
        counted = weights > 0.0
        behind = np.any((depth <= 0.0) & counted, axis=1)
        depth = np.where(counted, depth, 1.0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        inverse = 1.0 / depth
        flat = c[:, :2] * inverse[:, None]
        scale, size = genes[:, 1:3], genes[:, :1] * genes[:, 1:3]
        rows = np.zeros((n, len(GENES), 2, m))
        rows[:, 0] = scale[..., None] * flat
        rows[:, 1, 0], rows[:, 2, 1] = genes[:, :1] * flat[:, 0], genes[:, :1] * flat[:, 1]
        rows[:, 3, 0] = rows[:, 4, 1] = 1.0
        stretch = size[..., None] * inverse[:, None]
        rows[:, 5, 0], rows[:, 6, 1] = stretch[:, 0], stretch[:, 1]
        rows[:, 7] = -stretch * flat
        spun = _spins(genes[:, ANGLES]) @ turned[:, None]
        rows[:, 8:] = stretch[:, None] * (spun[:, :, :2] - flat[:, None] * spun[:, :, 2:])
        off = size[..., None] * flat + genes[:, 3:5, None] - model.pixels.T
    return off, rows, behind


def _spins(angles: Array) -> Array:
    """Return the matrices (N, 3, 3, 3) that carry a turned point to its rate with each angle."""
    so, co = np.sin(angles[:, 0]), np.cos(angles[:, 0])
    sp, cp = np.sin(angles[:, 1]), np.cos(angles[:, 1])
    out = np.zeros((len(angles), 3, 3, 3))
    # Each is the cross product with the axis of its angle: x, then y turned by omega, then z
    # turned by both.
    out[:, 0, 1, 2], out[:, 0, 2, 1] = -1.0, 1.0
    axes = ((1, 0.0, co, so), (2, sp, -so * cp, co * cp))
    for k, x, y, z in axes:
        out[:, k, 0, 1], out[:, k, 0, 2] = -z, y
        out[:, k, 1, 0], out[:, k, 1, 2] = z, -x
        out[:, k, 2, 0], out[:, k, 2, 1] = -y, x
    return out


def place_derivative(alpha_u: Array, alpha_v: Array, x: Array, y: Array, depth: Array) -> Array:
    """Return d pixel / d place in the camera frame (..., 2, 3) px/mm, at x / z, y / z and z."""
    out = np.zeros((*depth.shape, 2, 3))
    out[..., 0, 0] = alpha_u / depth
    out[..., 0, 2] = -alpha_u * x / depth
    out[..., 1, 1] = alpha_v / depth
    out[..., 1, 2] = -alpha_v * y / depth
    return out
