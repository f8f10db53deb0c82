"""Solving in spite of one or two wrong marks: named beyond doubt they are left out, else they stay.

What stays in spoils the fit, and a spoilt fit is refused: leaving out is allowed to lose a picture,
never to make a wrong pose look right.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from legato.calibration.camera import explains
from legato.calibration.cost import prepare
from legato.calibration.degeneracy import inspect
from legato.calibration.heldout import Suspects, held_out, suspects, without
from legato.calibration.problem import CalibrationError, EngineSettings, Problem, Solution
from legato.calibration.solve import solve
from legato.calibration.uncertainty import misfit, noise_limit
from legato.geometry.leg import PAPER_MARKS, Point

# Where some marks were wrong others may be, a little: what is left has to fit better than a set
# that was sound from the start. Noise alone passes the first once in twenty, the second in 1,000.
REST_QUANTILE, REST_HELD_OUT = 1.645, 2.6
# And an error too small for these tests to see may hide in it: its sigmas count so many times.
REST_WIDENING = 2.0


@dataclass(frozen=True)
class Robust:
    """A solution, the problem that it solves, and the marks of the first one it does without.

    `suspects` speaks of `problem`: its misfit tells whether what is left fits. `all_marks` speaks
    of the problem with every mark.
    """

    solution: Solution
    problem: Problem
    left_out: tuple[str, ...]
    suspects: Suspects
    all_marks: Suspects


def solve_robust(
    problem: Problem,
    engine: str,
    settings: EngineSettings,
    rng: np.random.Generator,
    marks: Mapping[str, Point] = PAPER_MARKS,
) -> Robust:
    """Solve; where one or two marks beyond doubt spoil the fit, solve again without them.

    They are left out only if their absence heals the fit, nothing else explains it about as well,
    another camera neither, and the rest is enough and not degenerate; the sigmas are then doubled.
    Raises CalibrationError as `solve` does.
    """
    whole = solve(problem, engine, settings, rng, marks)
    first = suspects(problem, whole, settings, rng)
    unchanged = Robust(whole, problem, (), first, first)
    if not first.names or first.others:
        return unchanged
    # What the marks hold against one of them they may hold against the camera's file.
    if explains(problem, whole.genes):
        return unchanged
    rest = without(problem, first.names)
    # With free intrinsics one mark off the plane of all others decides alone: it has no judge.
    if problem.known is None and not inspect(rest, marks).linear_start:
        return unchanged
    try:
        solution = solve(rest, engine, settings, rng, marks)
    except CalibrationError:
        return unchanged
    if not _agrees(rest, solution):
        return unchanged
    left = suspects(rest, solution, settings, rng)
    return Robust(_widened(solution), rest, first.names, left, first)


def _agrees(problem: Problem, solution: Solution) -> bool:
    """Say whether the marks left fit one another, together and each as the others predict it."""
    value, freedom = misfit(prepare(problem), solution.genes)
    if value > noise_limit(freedom, REST_QUANTILE):
        return False
    return all(row.ratio <= REST_HELD_OUT for row in held_out(problem, solution))


def _widened(solution: Solution) -> Solution:
    """Return the solution with all its sigmas larger by REST_WIDENING."""
    return replace(
        solution,
        covariance=solution.covariance * REST_WIDENING**2,
        sigma_rotation=solution.sigma_rotation * REST_WIDENING,
        sigma_translation=solution.sigma_translation * REST_WIDENING,
        sigma_stations=solution.sigma_stations * REST_WIDENING,
    )
