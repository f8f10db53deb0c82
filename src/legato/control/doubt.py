"""What may be wrong though every mark fits: the camera's file, the leg's size, a leg that moved.

A fit that is good proves little. These put the same marks, or a second picture's, to a question
that the fit was not asked, and answer in mm at the stations where they can.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from legato.calibration.camera import FREED, let_free
from legato.calibration.cost import prepare
from legato.calibration.problem import KnownIntrinsics, Problem, pose_of
from legato.calibration.refine import refine
from legato.calibration.uncertainty import covariance_of, misfit, noise_limit, station_sigmas
from legato.control.perceive import Calibration
from legato.geometry.projection import project
from legato.geometry.transforms import Array, apply
from legato.vision.marks import FoundMark, Picking

LEAST_SECOND = 5  # marks that two pictures must share; four give a pose that nothing tests
OUTLIER = 4.0  # sigmas from the median beyond which one mark's size tells of that mark alone


@dataclass(frozen=True)
class CameraDoubt:
    """What letting the camera go free changes.

    `gain` is the chi-square that it saves and `limit` the most that noise does (one in 1,000);
    `moved_mm` is how far the worst station goes, `alpha` the new focal length over the old.
    """

    gain: float
    limit: float
    moved_mm: float
    alpha: float


@dataclass(frozen=True)
class Moved:
    """How a second picture's leg lies against the first's.

    `mm` is the largest distance between a station's two places with twice its standard deviation,
    `px` the rms distance of marks from where the first puts them, `misfit` and `limit` the
    chi-square of the second picture's own pose, `count` the marks that both pictures share.
    """

    mm: float
    px: float
    misfit: float
    limit: float
    count: int


def camera_doubt(calibration: Calibration) -> CameraDoubt | None:
    """Return what freeing the known camera's alpha and principal point changes; None if free."""
    problem, genes = calibration.problem, calibration.solution.genes
    if problem.known is None or calibration.solution.engine == "paper":
        return None
    i = problem.known.intrinsics
    before, _ = misfit(prepare(problem), genes)
    after, better = let_free(problem, genes)
    apart = _apart(pose_of(genes), pose_of(better), problem.stations)
    alpha = float(np.sqrt(np.abs(np.prod(better[1:3] / [i.alpha_u, i.alpha_v]))))
    return CameraDoubt(before - after, noise_limit(FREED), float(apart.max(initial=0.0)), alpha)


def moved(calibration: Calibration, second: Picking, pixel_sigma: float) -> Moved:
    """Return how a second picture's marks, and the pose that they give, agree with the first."""
    first, solution = calibration.problem, calibration.solution
    names = tuple(n for n in first.names if n in second.marks)
    if len(names) < LEAST_SECOND:
        return Moved(np.inf, np.inf, np.inf, 0.0, len(names))
    points = first.points[[first.names.index(n) for n in names]]
    seen = np.array([(second.marks[n].u, second.marks[n].v) for n in names])
    sigma = np.array([max(second.marks[n].sigma, pixel_sigma) for n in names])
    apart = project(solution.intrinsics, solution.camera_from_object, points) - seen
    px = float(np.sqrt(np.mean(np.sum(apart**2, axis=-1))))
    # One camera took both, so its own error moves both poses alike and tells nothing here.
    camera = KnownIntrinsics(solution.intrinsics)
    problem = Problem(names, points, seen, sigma, first.bounds, camera, first.stations, first.size)
    model = prepare(problem)
    i = solution.intrinsics
    start = np.array([1.0, i.alpha_u, i.alpha_v, i.u0, i.v0, *solution.genes[5:]])
    found = refine(model, start[None])
    if not np.isfinite(found.cost[0]):
        return Moved(np.inf, px, np.inf, 0.0, len(names))
    genes = found.genes[0]
    value, freedom = misfit(model, genes)
    spread = station_sigmas(covariance_of(problem, model, genes), genes, first.stations)
    away = _apart(solution.camera_from_object, pose_of(genes), first.stations) + 2.0 * spread
    return Moved(float(away.max(initial=0.0)), px, value, noise_limit(freedom), len(names))


def mark_size(marks: Mapping[str, FoundMark]) -> tuple[float, float]:
    """Return the marks' mean size over the model's and its sigma; 1 and infinite if unknown."""
    rows = [(m.size, m.size_sigma) for m in marks.values() if np.isfinite(m.size_sigma)]
    if not rows:
        return 1.0, float("inf")
    size, sigma = np.array(rows).T
    order = np.argsort(size)
    half = np.searchsorted(np.cumsum(sigma[order] ** -2.0), 0.5 * np.sum(sigma**-2.0))
    middle = size[order][min(int(half), len(order) - 1)]
    # A mark cut badly or covered at its rim speaks for itself, not for the leg.
    weight = sigma**-2.0 * (np.abs(size - middle) <= OUTLIER * np.maximum(sigma, 1e-3))
    return float(weight @ size / weight.sum()), float(weight.sum() ** -0.5)


def _apart(a: Array, b: Array, points: Array) -> Array:
    """Return how far two poses put points (S, 3) apart (S,), mm."""
    return np.asarray(np.linalg.norm(apply(a, points) - apply(b, points), axis=-1))
