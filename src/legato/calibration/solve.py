"""The way in: check a problem, refuse what cannot be solved, and hand the rest to an engine."""

from collections.abc import Callable, Mapping

import numpy as np

from legato.calibration.degeneracy import inspect
from legato.calibration.hybrid import solve_hybrid
from legato.calibration.paper import solve_paper
from legato.calibration.problem import CalibrationError, EngineSettings, Problem, Solution
from legato.calibration.search import check_settings
from legato.calibration.separable import solve_separable
from legato.geometry.leg import PAPER_MARKS, Point

Engine = Callable[[Problem, EngineSettings, np.random.Generator], Solution]
ENGINES: Mapping[str, Engine] = {
    "hybrid": solve_hybrid,
    "paper": solve_paper,
    "separable": solve_separable,
}
# Ten unknowns: seven marks leave four equations to test the fit with. With a known camera six
# unknowns remain: six marks leave as many equations over, and any one mark can be left out.
LEAST_FREE, LEAST_KNOWN = 7, 6


def solve(
    problem: Problem,
    engine: str,
    settings: EngineSettings,
    rng: np.random.Generator,
    marks: Mapping[str, Point] = PAPER_MARKS,
) -> Solution:
    """Return camera and pose of a problem by the named engine.

    `marks` are all that the leg carries, to name those worth adding. Raises CalibrationError for
    data that is not usable, too few marks, a degenerate set, or unusable settings.
    """
    if engine not in ENGINES:
        raise CalibrationError(f"engine {engine!r} is unknown", f"use {', '.join(ENGINES)}")
    check_settings(settings)
    check_data(problem)
    check_count(problem, free=problem.known is None or engine == "paper")
    report = inspect(problem, marks)
    if report.refused:
        raise CalibrationError(report.refused)
    return ENGINES[engine](problem, settings, rng)


def check_data(problem: Problem) -> None:
    """Raise CalibrationError for names, shapes or values that do not make a problem."""
    names = problem.names
    m = len(names)
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise CalibrationError(f"{', '.join(twice)} given more than once", "give each mark once")
    for what, value, shape in (
        ("points", problem.points, (m, 3)),
        ("pixels", problem.pixels, (m, 2)),
        ("sigma", problem.sigma, (m,)),
    ):
        array = np.asarray(value, dtype=float)
        if array.shape != shape:
            raise CalibrationError(f"{what} have shape {array.shape}", f"{m} marks need {shape}")
        bad = [n for n, row in zip(names, array, strict=True) if not np.isfinite(row).all()]
        if bad:
            raise CalibrationError(f"{what} of {', '.join(bad)} are not finite numbers")
    if (np.asarray(problem.sigma) <= 0.0).any():
        raise CalibrationError("sigma must be above zero for every mark")
    _check_apart(problem)
    if problem.known is not None:
        _check_known(problem)


def check_count(problem: Problem, free: bool) -> None:
    """Raise CalibrationError for fewer marks than can be solved and tested."""
    least = LEAST_FREE if free else LEAST_KNOWN
    if len(problem.names) < least:
        camera = "free" if free else "known"
        raise CalibrationError(
            f"{_counted(len(problem.names))} too few with {camera} intrinsics",
            f"find at least {least}",
        )


def _check_apart(problem: Problem) -> None:
    """Raise CalibrationError where two marks share a place on the leg or in the picture."""
    for what, places in (("on the leg", problem.points), ("in the picture", problem.pixels)):
        p = np.asarray(places, dtype=float)
        distance = np.linalg.norm(p[:, None] - p[None], axis=2) + np.eye(len(p))
        if (distance < 1e-6).any():
            i, j = np.argwhere(distance < 1e-6)[0]
            raise CalibrationError(
                f"{problem.names[i]} and {problem.names[j]} are at one place {what}"
            )


def _check_known(problem: Problem) -> None:
    """Raise CalibrationError for known intrinsics that no camera has."""
    assert problem.known is not None
    i, c = problem.known.intrinsics, np.asarray(problem.known.covariance, dtype=float)
    if (i.width, i.height) != tuple(problem.size):
        raise CalibrationError(
            f"the known intrinsics are of pictures of {i.width}x{i.height} px, this one has "
            f"{problem.size[0]}x{problem.size[1]}",
            "take pictures of that size, or calibrate the camera at this one",
        )
    values = [i.alpha_u, i.alpha_v, i.u0, i.v0, i.k1, i.k2]
    if not np.isfinite(values).all() or i.alpha_u <= 0.0 or i.alpha_v <= 0.0:
        raise CalibrationError("known intrinsics must be finite, alpha_u and alpha_v positive")
    if c.shape != (6, 6) or not np.isfinite(c).all():
        raise CalibrationError(f"covariance of the intrinsics has shape {c.shape}", "give 6 by 6")
    if not np.allclose(c, c.T, rtol=1e-6) or np.linalg.eigvalsh(c).min() < -1e-9 * np.trace(c):
        raise CalibrationError("covariance of the intrinsics is not symmetric and positive")


def _counted(marks: int) -> str:
    return "1 mark is" if marks == 1 else f"{marks} marks are"
