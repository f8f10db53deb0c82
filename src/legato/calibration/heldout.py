"""Marks left out of the fit: how well the others predict them, and which of them are wrong.

A fit that has seen a mark cannot test it. Here every mark is predicted by the others, all fits in
one batch; where the whole set fits worse than noise, the marks whose absence heals it are named.
"""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from legato.calibration.cost import Model, mark_costs, prepare, residuals
from legato.calibration.degeneracy import inspect
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
# Genes drawn to start from, and how many of them each group refines: more where one mark off the
# plane of the others makes local minima.
CROWD, STARTS, WIDE_STARTS, ROUNDS = 2000, 8, 32, 50


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
    """The chi-square left without a group of marks, what noise passes, and the fit (11,)."""

    misfit: float
    limit: float
    names: tuple[str, ...]
    genes: Array

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
    """Name the one or two marks that spoil a fit; each subset is solved anew, from everywhere.

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
    low, high = model.search
    crowd = rng.uniform(low, high, (max(CROWD, settings.population), len(low)))
    for count in (1, 2):
        groups = [g for g in combinations(problem.names, count) if _testable(problem, g)]
        trials = _trials(problem, model, groups, crowd, refined.genes)
        if trials and trials[0].heals:
            # What explains the marks as well may lie where the first search did not start.
            again = _trials(problem, model, groups, crowd, trials[0].genes[None])
            return _verdict(trials + again, value, limit)
    return Suspects((), (), value, limit, explained=False)


def _verdict(trials: list[_Trial], value: float, limit: float) -> Suspects:
    """Return whom the best of the trials names, and who else may be to blame."""
    best = min(trials, key=lambda t: t.misfit)
    rivals = [t for t in trials if t.heals or t.misfit < best.misfit + DECISIVE]
    others = {n for t in rivals for n in t.names} - set(best.names)
    return Suspects(best.names, tuple(sorted(others)), value, limit, explained=True)


def _testable(problem: Problem, names: tuple[str, ...]) -> bool:
    """Say whether enough marks remain without `names` for their misfit to mean anything."""
    least = LEAST_FREE if problem.known is None else LEAST_KNOWN
    return len(problem.names) - len(names) >= least


def _trials(
    problem: Problem,
    model: Model,
    groups: list[tuple[str, ...]],
    crowd: Array,
    starts: Array,
) -> list[_Trial]:
    """Return how the rest fits without each group, best first; all groups are refined together.

    Each starts from those of a `crowd` (N, 11), drawn from the whole box, that its own marks like
    best, and from `starts` (K, 11).
    """
    if not groups:
        return []
    squares = mark_costs(model, crowd)
    kept = np.array([[n not in g for n in problem.names] for g in groups])
    first, owner = [], []
    for i, keep in enumerate(kept):
        count = STARTS if problem.known is not None or _sound(problem, groups[i]) else WIDE_STARTS
        best = np.argpartition(squares @ keep, count)[:count]
        first.append(np.concatenate([crowd[best], starts]))
        owner.append(np.full(count + len(starts), i))
    of = np.concatenate(owner)
    weights = model.weights * kept
    fits = refine(model, np.concatenate(first), weights[of], rounds=ROUNDS)
    trials = []
    for i, group in enumerate(groups):
        mine = np.flatnonzero(of == i)
        genes = fits.genes[mine[np.argmin(fits.cost[mine])]]
        value, freedom = misfit(model, genes, weights[i])
        trials.append(_Trial(value, noise_limit(freedom), group, genes))
    return sorted(trials, key=lambda t: t.misfit)


def _sound(problem: Problem, names: tuple[str, ...]) -> bool:
    """Say whether the marks without `names` have no local minima to fear."""
    return inspect(without(problem, names)).linear_start


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
