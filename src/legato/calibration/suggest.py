"""Which marks to use where not all are wanted: the subset with the least uncertainty in mm."""

from itertools import combinations

import numpy as np

from legato.calibration.cost import prepare
from legato.calibration.degeneracy import inspect
from legato.calibration.heldout import without
from legato.calibration.problem import CalibrationError, Problem
from legato.calibration.uncertainty import covariance_of, station_sigmas
from legato.geometry.transforms import Array


def suggest(problem: Problem, genes: Array, count: int = 7) -> tuple[str, ...]:
    """Return the `count` marks that leave the worst station best known, at the pose of `genes`.

    Without stations the translation is judged. Degenerate subsets are left out; raises
    CalibrationError where none remains.
    """
    model = prepare(problem)
    found: list[tuple[float, tuple[str, ...]]] = []
    for chosen in combinations(range(len(problem.names)), count):
        names = tuple(problem.names[i] for i in chosen)
        weights = np.zeros(len(problem.names))
        weights[list(chosen)] = model.weights[list(chosen)]
        covariance = covariance_of(problem, model, genes, weights)
        worst = station_sigmas(covariance, genes, problem.stations)
        spread = worst.max() if worst.size else np.sqrt(np.trace(covariance[7:, 7:]))
        found.append((float(spread), names))
    for _, names in sorted(found):
        rest = tuple(n for n in problem.names if n not in names)
        if not inspect(without(problem, rest)).refused:
            return names
    raise CalibrationError(
        f"no {count} of {len(problem.names)} marks lie off one plane", "show face and side"
    )
