"""What letting a known camera go free would change: whether the camera, not a mark, is wrong."""

from dataclasses import replace

import numpy as np

from legato.calibration.cost import prepare
from legato.calibration.problem import KnownIntrinsics, Problem
from legato.calibration.refine import refine
from legato.calibration.uncertainty import misfit, noise_limit
from legato.geometry.transforms import Array

OPEN_ALPHA, OPEN_CENTRE = 0.1, 60.0  # how far a camera let free may go: share, px
FREED = 4  # alpha_u, alpha_v, u0, v0


def let_free(problem: Problem, genes: Array) -> tuple[float, Array]:
    """Return the least chi-square with the known camera free, and its genes (11,).

    Refined from `genes` (11,); the distortion stays as it is known. ValueError where the camera is
    not known.
    """
    if problem.known is None:
        raise ValueError("the camera is free already")
    i = problem.known.intrinsics
    far = (OPEN_ALPHA * i.alpha_u, OPEN_ALPHA * i.alpha_v, OPEN_CENTRE, OPEN_CENTRE, 0.0, 0.0)
    model = prepare(replace(problem, known=KnownIntrinsics(i, np.diag(np.square(far)))))
    better = refine(model, genes[None]).genes[0]
    return misfit(model, better)[0], better


def explains(problem: Problem, genes: Array) -> bool:
    """Say whether another camera would make every mark fit, as far as noise can tell."""
    if problem.known is None:
        return False
    freedom = misfit(prepare(problem), genes)[1] - FREED
    return freedom > 0 and let_free(problem, genes)[0] <= noise_limit(freedom)
