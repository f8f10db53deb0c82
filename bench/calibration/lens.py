"""One camera from ten views laid as legato.calibration.views says, and the paper's scatter."""

from dataclasses import replace
from multiprocessing import Pool
from typing import Any

import numpy as np

from bench.calibration.scenes import LEG, Scene, facing, seen
from bench.calibration.ways import SETTINGS
from bench.row import Row
from legato.calibration.problem import KnownIntrinsics
from legato.calibration.solve import solve
from legato.calibration.views import calibrate_views
from legato.geometry.projection import Intrinsics, project
from legato.geometry.transforms import (
    Array,
    invert,
    look_at,
    rotation_from_angles,
    rotation_from_vector,
    transform,
)

CAMERA = Intrinsics(652.0, 655.0, 346.0, 279.0, -0.03, 0.0)
SIGMA = 0.25
VIEWS, SETS = 10, 40
LEAST_MARKS = 7
# Near, from before the big face's edge; where the camera aims along the leg, by turns.
EYE, TARGETS = (-25.0, -75.0, 55.0), ((40.0, -15.0, 5.0), (60.0, -15.0, 5.0), (85.0, -15.0, 5.0))
HAND_MM, HAND_DEG = 8.0, 12.0
# Rotation and translation of table 5.3.
PAPER_POSES = {
    "a": (-25.08, -14.54, 163.8, 1.662, 0.054, 0.64),
    "c": (-24.8, -13.75, 149.33, 1.66, 0.397, 1.04),
    "d": (-22.6, -3.14, 74.7, 1.71, 0.086, 0.705),
}


def view(number: int, rng: np.random.Generator) -> Scene:
    """Return one of the ten views as a hand makes it: a tenth of a turn further each."""
    while True:
        eye = np.array(EYE) + rng.uniform(-HAND_MM, HAND_MM, 3)
        target = np.array(TARGETS[number % 3]) + rng.uniform(-HAND_MM, HAND_MM, 3)
        roll = np.radians(360.0 / VIEWS * number + rng.uniform(-HAND_DEG, HAND_DEG))
        turn = transform(rotation_from_vector([0.0, 0.0, roll]), np.zeros(3))
        pose = turn @ invert(look_at(eye, target))
        names = visible(pose)
        if len(names) >= LEAST_MARKS:
            return seen(CAMERA, pose, names, SIGMA, rng)


def visible(pose: Array) -> tuple[str, ...]:
    """Return the marks that face the camera and lie in its picture."""
    pixels = project(CAMERA, pose, LEG.points())
    with np.errstate(invalid="ignore"):
        good = (facing(pose) > 0.2) & (CAMERA.sees(pixels, margin=8.0) > 0)
    return tuple(n for n, g in zip(LEG.names(), good, strict=True) if g)


def bundle(number: int) -> tuple[Array, Array, list[float], list[float]]:
    """Return a set's errors and sigmas (6,), and alpha over poses a, c, d with and without it."""
    rng = np.random.default_rng((11, number))
    problems = [view(k, rng).problem for k in range(VIEWS)]
    known = calibrate_views(problems, SETTINGS, rng).known
    with_it, without = scatter(known, number)
    return (
        values(known.intrinsics) - values(CAMERA),
        np.sqrt(np.diag(known.covariance)),
        with_it,
        without,
    )


def scatter(known: KnownIntrinsics, number: int) -> tuple[list[float], list[float]]:
    """Return alpha_u of one camera in the paper's poses a, c, d: known to a prior, and free."""
    rng = np.random.default_rng((12, number))
    camera = replace(CAMERA, k1=0.0)
    out: tuple[list[float], list[float]] = ([], [])
    for numbers in PAPER_POSES.values():
        pose = transform(rotation_from_angles(numbers[3:]), numbers[:3])
        problem = seen(camera, pose, LEG.names(), SIGMA, rng).problem
        lens = replace(known, intrinsics=replace(known.intrinsics, k1=0.0, k2=0.0))
        for places, p in zip(out, (replace(problem, known=lens), problem), strict=True):
            places.append(solve(p, "hybrid", SETTINGS, rng).intrinsics.alpha_u)
    return out


def values(camera: Intrinsics) -> Array:
    """Return the six intrinsics."""
    c = camera
    return np.array([c.alpha_u, c.alpha_v, c.u0, c.v0, c.k1, c.k2])


def spread(alphas: list[float]) -> float:
    """Return the range of alphas in percent of their mean."""
    return 100.0 * float(np.ptp(alphas) / np.mean(alphas))


def measure(processes: int = 2) -> tuple[list[Row], dict[str, Any]]:
    """Return the rows and what belongs to them."""
    with Pool(processes) as pool:
        found = pool.map(bundle, range(SETS), chunksize=2)
    error = np.array([f[0] for f in found])
    sigma = np.array([f[1] for f in found])
    alpha = 100.0 * np.abs(error[:, :2] / values(CAMERA)[:2]).max(axis=1)
    centre = np.abs(error[:, 2:4]).max(axis=1)
    k1 = np.abs(error[:, 4])
    kept, free = [spread(f[2]) for f in found], [spread(f[3]) for f in found]
    inside = float((np.abs(error / sigma) <= 2.0).mean())
    rows = [
        Row("calibration: ten views, error of alpha, median set", float(np.median(alpha)), "%", 0.3,
            note=f"{(alpha <= 0.3).mean():.0%} of {SETS} sets within it, worst {alpha.max():.2f}"),
        Row("calibration: ten views, principal point, median set", float(np.median(centre)), "px",
            2.0, note=f"{(centre <= 2.0).mean():.0%} within 2 px, worst {centre.max():.1f}"),
        Row("calibration: ten views, k1, median set", float(np.median(k1)), "", 0.01,
            note=f"true {CAMERA.k1}, worst {k1.max():.3f}"),
        Row("calibration: ten views, errors within 2 sigma", 100 * inside, "%"),
        Row("calibration: alpha over poses a, c, d with the bundle's prior, worst set",
            max(kept), "%", 1.0, note=f"free: median {np.median(free):.0f} %, the paper's 59 %"),
    ]  # fmt: skip
    return rows, {
        "lens_rms_error": np.sqrt(np.mean(error**2, axis=0)).tolist(),
        "lens_mean_sigma": sigma.mean(axis=0).tolist(),
        "scatter_percent": {"prior": kept, "free": free},
    }
