"""`engine = "separable"`: only rotation and depth are searched, the rest follows by least squares.

With rotation and t_z fixed the projection is linear in alpha_u, alpha_u t_x and u0 (and likewise
for v); with known intrinsics the whole translation is linear. Four genes, or three, remain.
"""

import numpy as np

from legato.calibration.cost import Model, in_camera, split_alphas
from legato.calibration.hybrid import Searched, solve_searched
from legato.calibration.problem import EngineSettings, Problem, Solution
from legato.geometry.transforms import Array

# Four genes, or three, need fewer generations than eleven or six, and fewer elites.
SHORTER, WIDE_ELITES = 5, 16


def solve_separable(
    problem: Problem, settings: EngineSettings, rng: np.random.Generator
) -> Solution:
    """Return the optimum within the bounds, found over rotation and depth alone."""
    if problem.known is None:
        searched = Searched(np.array([8, 9, 10, 7]), complete_free, SHORTER, WIDE_ELITES)
    else:
        searched = Searched(np.array([8, 9, 10]), complete_known, SHORTER, WIDE_ELITES)
    return solve_searched(problem, "separable", searched, settings, rng)


def complete_free(model: Model, genes: Array) -> Array:
    """Return whole genes (N, 11) of omega, phi, kappa, t_z (N, 4), clamped to the bounds."""
    whole = np.zeros((len(genes), 11))
    whole[:, 8:11], whole[:, 7] = genes[:, :3], genes[:, 3]
    turned, c = in_camera(model.points, whole)
    # Behind the camera the cost is infinite whatever is put here.
    depth = np.where(np.abs(c[:, 2:]) > 1e-9, c[:, 2:], 1e-9)
    low, high = model.search
    sizes = np.array([low[:1] * low[1:3], high[:1] * high[1:3]])
    origins, alphas, moved = _lines(
        turned[:, :2] / depth, 1.0 / depth, model.pixels.T, model.weights**2,
        model.search[:, 3:5], sizes,
    )  # fmt: skip
    whole[:, 3:5] = origins
    whole[:, 5:7] = np.clip(moved / alphas, low[5:7], high[5:7])
    whole[:, :3] = split_alphas(alphas, model.search)
    return whole


def _lines(
    a: Array, b: Array, seen: Array, weight: Array, origins: Array, sizes: Array
) -> tuple[Array, Array, Array]:
    """Return u0, alpha and alpha t (N, 2), an axis each, of seen = alpha a + (alpha t) b + u0.

    `a` (N, 2, M), `b` (N, 1, M), `seen` (2, M), `weight` (M,). What leaves its bounds, `origins`
    and then `sizes` (2, 2), is put on them and the rest fitted again.
    """
    middle = origins.mean(axis=0)
    y = seen - middle[:, None]
    a_1, b_1, y_1, one = a @ weight, b @ weight, y @ weight, weight.sum()
    aa, ab, bb = (a * a) @ weight, (a * b) @ weight, (b * b) @ weight
    ay, by = (a * y) @ weight, (b * y) @ weight
    alpha, moved = _two(
        aa - a_1 * a_1 / one,
        ab - a_1 * b_1 / one,
        bb - b_1 * b_1 / one,
        ay - a_1 * y_1 / one,
        by - b_1 * y_1 / one,
    )
    origin = np.clip((y_1 - alpha * a_1 - moved * b_1) / one, *(origins - middle))
    ay, by = ay - origin * a_1, by - origin * b_1
    alpha = np.clip(_two(aa, ab, bb, ay, by)[0], *sizes)
    return origin + middle, alpha, (by - alpha * ab) / bb


def _two(aa: Array, ab: Array, bb: Array, ay: Array, by: Array) -> tuple[Array, Array]:
    """Return p, q of y = p a + q b by least squares from sums of products; zero for none."""
    determinant = aa * bb - ab * ab
    sound = determinant > 1e-12 * aa * bb
    scale = np.where(sound, 1.0 / np.where(sound, determinant, 1.0), 0.0)
    return (bb * ay - ab * by) * scale, (aa * by - ab * ay) * scale


def complete_known(model: Model, genes: Array) -> Array:
    """Return whole genes (N, 11) of omega, phi, kappa (N, 3): the translation is linear."""
    whole = np.tile(model.mean, (len(genes), 1))
    whole[:, 5:8], whole[:, 8:11] = 0.0, genes
    turned, _ = in_camera(model.points, whole)
    f, s_x, s_y, u0, v0 = model.mean[:5]
    x, y = (model.pixels - [u0, v0]).T / np.array([[f * s_x], [f * s_y]])
    m = len(x)
    rows = np.zeros((2, m, 3))
    rows[0, :, 0] = rows[1, :, 1] = 1.0
    rows[0, :, 2], rows[1, :, 2] = -x, -y
    w = np.tile(model.weights, 2)
    right = np.concatenate([s * turned[:, 2] - turned[:, k] for k, s in ((0, x), (1, y))], axis=1)
    solver = np.linalg.pinv(rows.reshape(-1, 3) * w[:, None])
    whole[:, 5:8] = np.clip((right * w) @ solver.T, *model.search[:, 5:8])
    return whole
