"""The one cost that every engine lowers: weighted squared distance of marks from their projection.

A `Model` is a problem made ready once; then whole populations (N, 11) are priced in one call. Where
the intrinsics are known the pixels are undistorted first, so that the model is always a pinhole.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from legato.calibration.problem import GENES, CalibrationError, KnownIntrinsics, Problem
from legato.geometry.projection import pinhole_pixels
from legato.geometry.transforms import Array, rotation_from_angles

Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]

ANGLES = slice(8, 11)
POSE = slice(5, 11)
# So many genes are priced at a time that what lies between stays in the processor's cache.
BLOCK = 256
# Genes with a prior where the intrinsics are known: f is 1, so s_x and s_y are alpha_u and alpha_v.
PRIOR_GENES = np.array([1, 2, 3, 4])


@dataclass(frozen=True)
class Model:
    """A problem ready for pricing; genes that must not move have equal bounds.

    `weights` (M,) are sigma / sigma_of_mark, where `sigma` px is the harmonic reference: equal
    marks weigh 1, and costs stay in px^2. `search` (2, 11) bounds the genetic search, `box` (2, 11)
    the refinement of `tied` genes; genes that `wrap` run round the whole circle. `prior` (11, 11)
    is information in units of 1 / sigma^2 about `mean` (11,), or None.
    """

    points: Array
    pixels: Array
    weights: Array
    sigma: float
    search: Array
    box: Array
    wrap: Flags
    mean: Array
    prior: Array | None = None

    @property
    def refined(self) -> Indices:
        """Return the indices of the genes that the refinement may move."""
        return np.flatnonzero(self.box[1] > self.box[0])


def prepare(problem: Problem) -> Model:
    """Return the model of a problem; raises CalibrationError for unusable bounds."""
    search = checked_bounds(problem.bounds)
    information = 1.0 / np.square(problem.sigma)
    sigma = float(1.0 / np.sqrt(np.mean(information)))
    full_turn = np.zeros(len(GENES), dtype=bool)
    full_turn[ANGLES] = np.ptp(search[:, ANGLES], axis=0) >= 2.0 * np.pi - 1e-9
    search[:, full_turn] = [[-np.pi], [np.pi]]
    pixels, prior = np.asarray(problem.pixels, dtype=float), None
    box = search.copy()
    if problem.known is None:
        box = _alpha_box(box)
    else:
        pixels = pinhole_pixels(problem.known.intrinsics, pixels)
        search, box, prior = _fixed_intrinsics(problem.known, search, sigma)
    box[0, full_turn], box[1, full_turn] = -np.inf, np.inf
    return Model(
        points=np.asarray(problem.points, dtype=float),
        pixels=pixels,
        weights=sigma / np.asarray(problem.sigma, dtype=float),
        sigma=sigma,
        search=search,
        box=box,
        wrap=full_turn,
        mean=search.mean(axis=0),
        prior=prior,
    )


def checked_bounds(bounds: Mapping[str, tuple[float, float]]) -> Array:
    """Return bounds as (2, 11); raises CalibrationError naming the gene that is wrong."""
    missing = [gene for gene in GENES if gene not in bounds]
    if missing:
        raise CalibrationError(f"no bounds for {', '.join(missing)}", "give lower and upper")
    for gene in GENES:
        low, high = bounds[gene]
        if not (np.isfinite([low, high]).all() and low <= high):
            raise CalibrationError(
                f"bounds of {gene} are {low} and {high}", "give two finite numbers, lower first"
            )
    return np.array([bounds[gene] for gene in GENES], dtype=float).T


def _alpha_box(bounds: Array) -> Array:
    """Return the refinement's box: f held at 1, so that s_x and s_y are alpha_u and alpha_v.

    Free all three share a direction in which nothing changes. Where one is held already they do
    not, and the box stays as it is.
    """
    box = bounds.copy()
    if (bounds[1, :3] > bounds[0, :3]).all():
        box[:, 0] = 1.0
        box[:, 1:3] = bounds[:, :1] * bounds[:, 1:3]
    return box


def tied(model: Model, genes: Array) -> Array:
    """Return genes (N, 11) with f where the refinement's box holds it, and the same alphas."""
    low, high = model.box[:, 0]
    if high > low:
        return genes
    out = genes.copy()
    out[:, 0] = low
    out[:, 1:3] *= genes[:, :1] / low
    return out


def _fixed_intrinsics(
    known: KnownIntrinsics, bounds: Array, sigma: float
) -> tuple[Array, Array, Array | None]:
    """Return search bounds, refinement box and prior where the intrinsics are known."""
    i = known.intrinsics
    search = bounds.copy()
    search[:, :5] = [1.0, i.alpha_u, i.alpha_v, i.u0, i.v0]
    box = search.copy()
    covariance = np.asarray(known.covariance, dtype=float)[:4, :4]
    uncertain = np.flatnonzero(np.diag(covariance) > 0.0)
    if not uncertain.size:
        return search, box, None
    genes = PRIOR_GENES[uncertain]
    box[0, genes], box[1, genes] = -np.inf, np.inf
    prior = np.zeros((len(GENES), len(GENES)))
    part = covariance[np.ix_(uncertain, uncertain)]
    prior[np.ix_(genes, genes)] = np.linalg.inv(part) * sigma**2
    return search, box, prior


def in_camera(points: Array, genes: Array) -> tuple[Array, Array]:
    """Return points (M, 3) turned but not moved, and in the camera frame, each (N, 3, M), mm."""
    rotation = rotation_from_angles(genes[:, ANGLES])
    # One large product is several times quicker than N small ones.
    turned = (rotation.reshape(-1, 3) @ points.T).reshape(len(genes), 3, -1)
    return turned, turned + genes[:, 5:8, None]


def residuals(model: Model, genes: Array) -> Array:
    """Return predicted minus seen (N, M, 2) px of genes (N, 11), with no weights.

    The formula alone accepts points behind the camera: see `cost`.
    """
    _, c = in_camera(model.points, genes)
    with np.errstate(divide="ignore", invalid="ignore"):
        flat = c[:, :2] / c[:, 2:]
    predicted = flat * (genes[:, :1] * genes[:, 1:3])[:, :, None] + genes[:, 3:5, None]
    return np.asarray(np.swapaxes(predicted - model.pixels.T, 1, 2))


def mark_costs(model: Model, genes: Array) -> Array:
    """Return each mark's share (N, M) px^2 of the cost; 1e12 for a mark behind the camera."""
    out = np.empty((len(genes), len(model.points)))
    for start in range(0, len(genes), BLOCK):
        part = genes[start : start + BLOCK]
        off = residuals(model, part) * model.weights[:, None]
        square = np.sum(off * off, axis=2)
        behind = in_camera(model.points, part)[1][:, 2] <= 0.0
        out[start : start + BLOCK] = np.where(behind | ~np.isfinite(square), 1e12, square)
    return out


def cost(model: Model, genes: Array, weights: Array | None = None) -> Array:
    """Return the cost (N,) px^2 of genes (N, 11), prior included; infinite behind the camera.

    `weights` (M,) or (N, M) replace the model's; a weight of zero leaves a mark out.
    """
    w = model.weights if weights is None else weights
    if len(genes) <= BLOCK:
        return _block_cost(model, genes, w)
    out = np.empty(len(genes))
    for start in range(0, len(genes), BLOCK):
        part = slice(start, start + BLOCK)
        out[part] = _block_cost(model, genes[part], w[part] if w.ndim > 1 else w)
    return out


def _block_cost(model: Model, genes: Array, w: Array) -> Array:
    _, c = in_camera(model.points, genes)
    counted = w > 0.0
    behind = np.any((c[:, 2] <= 0.0) & counted, axis=1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        flat = c[:, :2] / c[:, 2:]
        flat *= (genes[:, :1] * genes[:, 1:3])[:, :, None]
        flat += genes[:, 3:5, None] - model.pixels.T
        flat *= np.where(counted, w, 0.0)[..., None, :]
        flat *= flat
        total = flat.sum(axis=(1, 2))
    if model.prior is not None:
        off = genes - model.mean
        total += np.einsum("ni,ij,nj->n", off, model.prior, off)
    total[behind | np.isnan(total)] = np.inf
    return np.asarray(total)


def split_alphas(alphas: Array, bounds: Array, f: Array | None = None) -> Array:
    """Return f, s_x, s_y (N, 3) inside bounds (2, 11) that make alpha_u, alpha_v (N, 2).

    They are not separately observable: `f` (N,) is kept where it may be, else the middle is taken.
    Where no f serves both, s_x or s_y leaves its bounds and alpha is kept.
    """
    low = np.maximum((alphas / bounds[1, 1:3]).max(axis=1), bounds[0, 0])
    high = np.minimum((alphas / bounds[0, 1:3]).min(axis=1), bounds[1, 0])
    wanted = np.sqrt(low * high) if f is None else f
    kept = np.clip(np.maximum(np.minimum(wanted, high), low), bounds[0, 0], bounds[1, 0])
    return np.concatenate([kept[:, None], alphas / kept[:, None]], axis=1)
