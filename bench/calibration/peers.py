"""Other ways to the same answer, for comparison only: each gives camera and pose, or None.

Where a peer needs a refinement inside the box it gets legato's own, so that only the way there
differs. cv2 has no box.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from bench.calibration.scenes import Scene
from legato.calibration.cost import Model, cost, prepare, split_alphas
from legato.calibration.problem import pose_of
from legato.calibration.refine import refine
from legato.geometry.projection import Intrinsics, project
from legato.geometry.transforms import (
    Array,
    angles_from_rotation,
    nearest_rotation,
    rotation_from_vector,
    transform,
)

SHORT_EVOLUTION = 100


@dataclass(frozen=True)
class Answer:
    """A camera, a pose, and their cost in px^2."""

    camera: Intrinsics
    pose: Array
    cost: float


Peer = Callable[[Scene, bool, int], Answer | None]


def answer(scene: Scene, camera: Intrinsics, pose: Array) -> Answer:
    """Return an answer with its cost; infinite where a mark lies behind the camera."""
    off = project(camera, pose, scene.problem.points) - scene.problem.pixels
    value = float(np.sum(off**2))
    return Answer(camera, pose, value if np.isfinite(value) else float("inf"))


def dlt_lm(scene: Scene, known: bool, seed: int) -> Answer | None:
    """Start from the direct linear transform, refine in the box. Free intrinsics only."""
    del seed
    if known:
        return None
    model = prepare(scene.problem)
    start = _dlt(scene.problem.points, scene.problem.pixels, model.search)
    return None if start is None else _refined(scene, model, start[None], known)


def _dlt(points: Array, pixels: Array, search: Array) -> Array | None:
    """Return the genes (11,) of the linear solution, brought into the box, or None."""
    to_points, p = _conditioned(points)
    to_pixels, x = _conditioned(pixels)
    one = np.concatenate([p, np.ones((len(p), 1))], axis=1)
    zero = np.zeros_like(one)
    rows = np.concatenate(
        [
            np.concatenate([one, zero, -x[:, :1] * one], axis=1),
            np.concatenate([zero, one, -x[:, 1:] * one], axis=1),
        ]
    )
    matrix = np.linalg.inv(to_pixels) @ np.linalg.svd(rows)[2][-1].reshape(3, 4) @ to_points
    matrix = matrix / np.linalg.norm(matrix[2, :3])
    if np.mean(points @ matrix[2, :3] + matrix[2, 3]) < 0.0:
        matrix = -matrix
    row = matrix[2, :3]
    centre = matrix[:2, :3] @ row
    alphas = np.linalg.norm(matrix[:2, :3] - centre[:, None] * row, axis=1)
    if not np.isfinite(matrix).all() or (alphas < 1e-6).any():
        return None
    upper = (matrix[:2] - centre[:, None] * matrix[2]) / alphas[:, None]
    rotation = nearest_rotation(np.vstack([upper[:, :3], row]))
    parts = split_alphas(alphas[None], search)[0]
    shift = [*upper[:, 3], matrix[2, 3]]
    return np.asarray(np.clip([*parts, *centre, *shift, *angles_from_rotation(rotation)], *search))


def _conditioned(places: Array) -> tuple[Array, Array]:
    """Return the similarity that centres places (M, D) at a mean distance of root D, and them."""
    middle = places.mean(axis=0)
    d = places.shape[1]
    scale = np.sqrt(d) / np.linalg.norm(places - middle, axis=1).mean()
    matrix = np.eye(d + 1) * scale
    matrix[d, d] = 1.0
    matrix[:d, d] = -scale * middle
    return matrix, (places - middle) * scale


def _refined(scene: Scene, model: Model, starts: Array, known: bool) -> Answer | None:
    found = refine(model, starts)
    best = int(np.argmin(found.cost))
    if not np.isfinite(found.cost[best]):
        return None
    g = found.genes[best]
    camera = scene.camera if known else Intrinsics(g[0] * g[1], g[0] * g[2], g[3], g[4])
    return Answer(camera, pose_of(g), float(found.cost[best]))


def calibrate_camera(scene: Scene, known: bool, seed: int) -> Answer | None:
    """Return cv2.calibrateCamera's, from a fair guess: 650 px, the middle of the paper's bounds."""
    del seed
    if known:
        return None
    guess = np.array([[650.0, 0.0, 320.0], [0.0, 650.0, 265.0], [0.0, 0.0, 1.0]])
    flags = cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_ZERO_TANGENT_DIST
    flags |= cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
    p = scene.problem
    try:
        _, matrix, _, turns, shifts = cv2.calibrateCamera(
            [p.points.astype(np.float32)],
            [p.pixels.astype(np.float32)],
            p.size,
            guess,
            np.zeros(5),
            flags=flags,
            criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12),
        )
    except cv2.error:
        return None
    camera = Intrinsics(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
    return answer(scene, camera, _pose(turns[0], shifts[0]))


def sqpnp(scene: Scene, known: bool, seed: int) -> Answer | None:
    """Return cv2.solvePnP's, SQPNP. Known intrinsics only."""
    del seed
    return _pnp(scene, polish=False) if known else None


def sqpnp_lm(scene: Scene, known: bool, seed: int) -> Answer | None:
    """Return cv2.solvePnP's, SQPNP, then cv2.solvePnPRefineLM. Known intrinsics only."""
    del seed
    return _pnp(scene, polish=True) if known else None


def _pnp(scene: Scene, polish: bool) -> Answer | None:
    p, matrix = scene.problem, scene.camera.matrix()
    try:
        ok, turn, shift = cv2.solvePnP(
            p.points, p.pixels, matrix, np.zeros(5), flags=cv2.SOLVEPNP_SQPNP
        )
        if ok and polish:
            turn, shift = cv2.solvePnPRefineLM(
                p.points, p.pixels, matrix, np.zeros(5), turn, shift,
                criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-14),
            )  # fmt: skip
    except cv2.error:
        return None
    return answer(scene, scene.camera, _pose(turn, shift)) if ok else None


def _pose(turn: ArrayLike, shift: ArrayLike) -> Array:
    return transform(rotation_from_vector(np.ravel(turn)), np.ravel(shift))


def evolution_lm(scene: Scene, known: bool, seed: int) -> Answer | None:
    """Return what scipy's differential evolution finds as it ships, refined."""
    return _evolution(scene, known, seed, 1000)


def short_evolution_lm(scene: Scene, known: bool, seed: int) -> Answer | None:
    """Return the same, cut off after 100 generations."""
    return _evolution(scene, known, seed, SHORT_EVOLUTION)


def _evolution(scene: Scene, known: bool, seed: int, generations: int) -> Answer | None:
    """One call prices a whole generation: the quickest way that scipy has."""
    from scipy.optimize import Bounds, differential_evolution

    model = prepare(scene.of(known))
    columns = np.arange(5, 11) if known else np.arange(11)
    box = model.search[:, columns]

    def whole(genes: Array) -> Array:
        out = np.tile(model.mean, (genes.shape[1], 1))
        out[:, columns] = genes.T
        return out

    def price(genes: Array, /) -> Array:
        return np.minimum(cost(model, whole(genes)), 1e12)

    found = differential_evolution(
        price,  # type: ignore[arg-type] # vectorised: it gives many values at a time
        Bounds(*box),
        maxiter=generations,
        polish=False,
        updating="deferred",
        vectorized=True,
        rng=np.random.default_rng(seed),
    )
    return _refined(scene, model, whole(found.x[:, None]), known)


def multistart(scene: Scene, known: bool, seed: int, count: int = 40) -> Answer:
    """Return the reference: the best refinement of the truth and of `count` random starts."""
    model, rng = prepare(scene.of(known)), np.random.default_rng(seed)
    true = scene.genes(known)
    spread = np.array([0.1, 2, 2, 5, 5, 5, 5, 5, 0.1, 0.1, 0.1])
    near = true + rng.normal(0.0, 1.0, (count // 4, 11)) * spread
    far = rng.uniform(model.search[0], model.search[1], (count - len(near), 11))
    best = _refined(scene, model, np.concatenate([true[None], near, far]), known)
    assert best is not None
    return best


PEERS: dict[str, Peer] = {
    "DLT + LM": dlt_lm,
    "cv2.calibrateCamera": calibrate_camera,
    "cv2.solvePnP SQPNP": sqpnp,
    "SQPNP + LM": sqpnp_lm,
    "scipy DE + LM": evolution_lm,
    "scipy DE, 100 generations, + LM": short_evolution_lm,
}
