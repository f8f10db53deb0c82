"""Marks left out of the fit: how well the others predict them, and which of them are wrong.

A fit that has seen a mark cannot test it. Here every mark is predicted by the others, all fits in
one batch; where the whole set fits worse than noise, the marks whose absence heals it are named.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from legato.calibration.cost import Model, prepare, residuals
from legato.calibration.degeneracy import inspect
from legato.calibration.hybrid import genes_to_search, search_and_refine
from legato.calibration.problem import EngineSettings, Problem, Solution
from legato.calibration.refine import refine
from legato.calibration.solve import LEAST_FREE, LEAST_KNOWN
from legato.calibration.uncertainty import (
    covariance_of,
    misfit,
    noise_limit,
    observed_jacobian,
)
from legato.geometry.transforms import Array

# One explanation is certain where every other has a chi-square larger by so much: odds of e^10.
DECISIVE = 20.0


@dataclass(frozen=True)
class HeldOut:
    """One mark as the others predict it.

    `residual_px` is the distance between predicted and seen, `sigma_px` the root mean square to
    expect of it, `ratio` the residual in its own error ellipse: its root mean square is 1, and
    noise passes 2.6 once in a thousand. Infinite where the others give no pose.
    """

    name: str
    residual_px: float
    sigma_px: float
    ratio: float


@dataclass(frozen=True)
class Suspects:
    """Marks without which the fit agrees with the noise, likeliest first.

    `misfit` and `limit` are the chi-square of all marks and what noise passes once in a thousand;
    `names` is empty where the misfit is within it. `explained` says whether leaving out `names`
    heals the fit; `others` are marks whose absence would explain it about as well: then none is
    certain.
    """

    names: tuple[str, ...]
    others: tuple[str, ...]
    misfit: float
    limit: float
    explained: bool


@dataclass(frozen=True)
class _Trial:
    """The chi-square left without a group of marks, and what noise passes once in a thousand."""

    misfit: float
    limit: float
    names: tuple[str, ...]

    @property
    def heals(self) -> bool:
        return self.misfit <= self.limit


def held_out(problem: Problem, solution: Solution) -> tuple[HeldOut, ...]:
    """Return, for each mark, how the fit of the others predicts it; refined from `solution`."""
    if solution.engine == "paper":
        problem = replace(problem, known=None)
    model = prepare(problem)
    m = len(problem.names)
    weights = model.weights * (1.0 - np.eye(m))
    fits = refine(model, np.tile(solution.genes, (m, 1)), weights)
    return tuple(
        _predicted(problem, model, i, fits.genes[i], weights[i], bool(np.isfinite(fits.cost[i])))
        for i in range(m)
    )


def _predicted(
    problem: Problem, model: Model, i: int, genes: Array, weights: Array, solved: bool
) -> HeldOut:
    """Return mark `i` as predicted by the fit `genes` (11,) in which it weighs nothing."""
    name = problem.names[i]
    # One plane seen by a known camera does give a pose, near the one that all marks gave.
    flat = problem.known is None and inspect(without(problem, (name,))).refused
    if not solved or flat:
        return HeldOut(name, float("inf"), float("inf"), float("inf"))
    off = residuals(model, genes[None])[0, i]
    j = observed_jacobian(model.points[i : i + 1], genes)[0]
    spread = j @ covariance_of(problem, model, genes, weights) @ j.T
    spread += np.eye(2) * float(problem.sigma[i]) ** 2
    ratio = float(np.sqrt(off @ np.linalg.solve(spread, off) / 2.0))
    return HeldOut(name, float(np.linalg.norm(off)), float(np.sqrt(np.trace(spread))), ratio)


def suspects(
    problem: Problem, solution: Solution, settings: EngineSettings, rng: np.random.Generator
) -> Suspects:
    """Name the one or two marks that spoil a fit; each subset is solved anew, not from the spoilt.

    A subset too small to be tested is not tried. One in a plane is: that it has no pose does not
    exonerate the marks that it lacks.
    """
    if solution.engine == "paper":
        problem = replace(problem, known=None)
    model = prepare(problem)
    refined = refine(model, solution.genes[None])
    value, freedom = misfit(model, refined.genes[0])
    limit = noise_limit(freedom)
    if value <= limit:
        return Suspects((), (), value, limit, explained=True)
    for count in (1, 2):
        groups = combinations(problem.names, count)
        found = [_without(problem, group, settings, rng) for group in groups]
        trials = sorted((t for t in found if t is not None), key=lambda t: t.misfit)
        if trials and trials[0].heals:
            best = trials[0]
            rivals = [t for t in trials[1:] if t.heals or t.misfit < best.misfit + DECISIVE]
            others = {n for t in rivals for n in t.names} - set(best.names)
            return Suspects(best.names, tuple(sorted(others)), value, limit, explained=True)
    return Suspects((), (), value, limit, explained=False)


def _without(
    problem: Problem, names: tuple[str, ...], settings: EngineSettings, rng: np.random.Generator
) -> _Trial | None:
    """Return how the rest fits when `names` are left out, or None where too few remain."""
    rest = without(problem, names)
    if len(rest.names) < (LEAST_FREE if problem.known is None else LEAST_KNOWN):
        return None
    model = prepare(rest)
    quick = replace(settings, search_generations=max(1, settings.search_generations // 3))
    wide = problem.known is None and not inspect(rest).linear_start
    _, refined = search_and_refine(model, genes_to_search(rest), quick, rng, wide)
    value, freedom = misfit(model, refined.genes[int(np.argmin(refined.cost))])
    return _Trial(value, noise_limit(freedom), names)


def without(problem: Problem, names: tuple[str, ...]) -> Problem:
    """Return the problem without the marks `names`."""
    keep = [i for i, n in enumerate(problem.names) if n not in names]
    return replace(
        problem,
        names=tuple(problem.names[i] for i in keep),
        points=problem.points[keep],
        pixels=problem.pixels[keep],
        sigma=problem.sigma[keep],
    )
