"""Solving in spite of one or two wrong marks: named beyond doubt they are left out, else they stay.

What stays in spoils the fit, and a spoilt fit is refused: leaving out is allowed to lose a picture,
never to make a wrong pose look right.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from legato.calibration.degeneracy import inspect
from legato.calibration.heldout import Suspects, suspects, without
from legato.calibration.problem import CalibrationError, EngineSettings, Problem, Solution
from legato.calibration.solve import solve
from legato.geometry.leg import PAPER_MARKS, Point


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
    and the rest is enough and not degenerate. Raises CalibrationError as `solve` does.
    """
    whole = solve(problem, engine, settings, rng, marks)
    first = suspects(problem, whole, settings, rng)
    unchanged = Robust(whole, problem, (), first, first)
    if not first.names or first.others:
        return unchanged
    rest = without(problem, first.names)
    # With free intrinsics one mark off the plane of all others decides alone: it has no judge.
    if problem.known is None and not inspect(rest, marks).linear_start:
        return unchanged
    try:
        solution = solve(rest, engine, settings, rng, marks)
    except CalibrationError:
        return unchanged
    left = suspects(rest, solution, settings, rng)
    if left.misfit > left.limit:
        return unchanged
    return Robust(solution, rest, first.names, left, first)
