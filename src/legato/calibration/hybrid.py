"""`engine = "hybrid"`: a short genetic search finds the valley, refinement its bottom.

Half of the elites come from the last population and half from the first one: those share no
ancestor, so that agreement among them certifies the optimum.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from legato.calibration.cost import Indices, Model, cost, prepare
from legato.calibration.degeneracy import inspect
from legato.calibration.outcome import agreement, outcome
from legato.calibration.problem import EngineSettings, Problem, Solution
from legato.calibration.refine import Refined, refine
from legato.calibration.search import Evolved, evolve
from legato.geometry.transforms import Array

# One mark off the plane of the others makes local minima: search wider, refine more.
WIDE_POPULATION, WIDE_GENERATIONS, WIDE_ELITES = 200, 20, 64
# There, more than half may agree on a local one: only so many of the slowest are not waited for.
WIDE_ENDED = 0.85
# Fewer elites than this at the best optimum: look again, wider.
LEAST_WITNESSES = 3


@dataclass(frozen=True)
class Searched:
    """Which genes the search moves, and how whole genes (N, 11) follow from them.

    `shorter` divides the generations: fewer genes need fewer. `wide_elites` is how many are refined
    in a wide search.
    """

    columns: Indices
    fill: Callable[[Model, Array], Array]
    shorter: int = 1
    wide_elites: int = WIDE_ELITES


def solve_hybrid(problem: Problem, settings: EngineSettings, rng: np.random.Generator) -> Solution:
    """Return the optimum within the bounds; intrinsics that are known are not searched."""
    return solve_searched(problem, "hybrid", genes_to_search(problem), settings, rng)


def genes_to_search(problem: Problem) -> Searched:
    """Return all eleven genes, or the six of the pose where the intrinsics are known."""
    free = problem.known is None
    columns = np.arange(11) if free else np.arange(5, 11)

    def fill(model: Model, genes: Array) -> Array:
        whole = np.tile(model.mean, (len(genes), 1))
        whole[:, columns] = genes
        return whole

    return Searched(columns, fill, shorter=1 if free else 3)


def solve_searched(
    problem: Problem,
    engine: str,
    searched: Searched,
    settings: EngineSettings,
    rng: np.random.Generator,
) -> Solution:
    """Return the optimum that search and refinement find, under the name of the engine."""
    model = prepare(problem)
    wide = problem.known is None and not inspect(problem).linear_start
    run, refined = search_and_refine(model, searched, settings, rng, wide)
    best = int(np.argmin(refined.cost))
    met = bool((refined.converged & refined.at_best()).any())
    return outcome(
        problem,
        model,
        engine,
        refined.genes[best],
        float(refined.cost[best]),
        agreement=agreement(refined),
        trace=run.trace,
        generations=run.generations,
        stopped_by="converged" if met else "generations",
    )


def search_and_refine(
    model: Model,
    searched: Searched,
    settings: EngineSettings,
    rng: np.random.Generator,
    wide: bool = False,
) -> tuple[Evolved, Refined]:
    """Search and refine; once more, wider, where too few elites witness the optimum."""
    columns = searched.columns
    box, wrap = model.search[:, columns], model.wrap[columns]

    def price(genes: Array) -> Array:
        return cost(model, searched.fill(model, genes))

    def once(wide: bool, found: Array) -> tuple[Evolved, Refined]:
        chosen = short(settings, wide, searched.shorter)
        run = evolve(price, box, wrap, chosen, rng, watched=slice(None))
        count = max(settings.search_elites, searched.wide_elites if wide else 1)
        starts = np.concatenate([searched.fill(model, elites(run, count)), found])
        # Half are the search's and half chance's: more than half agree only where both do.
        most = len(starts) // 2 + 1
        return run, refine(model, starts, None, enough=most, ended=_ended(len(starts), wide))

    run, refined = once(wide, np.zeros((0, 11)))
    witnesses = np.count_nonzero(refined.at_best())
    if not wide and witnesses < min(LEAST_WITNESSES, len(refined.cost)):
        return once(True, refined.genes[[int(np.argmin(refined.cost))]])
    return run, refined


def _ended(count: int, wide: bool) -> int:
    """Return how many starts must have come to an end: nearly all where local minima lurk."""
    return int(np.ceil(WIDE_ENDED * count)) if wide else 0


def short(settings: EngineSettings, wide: bool, shorter: int) -> EngineSettings:
    """Return the settings of the search that goes before refinement."""
    size, generations = settings.search_population, settings.search_generations
    if wide:
        size, generations = max(size, WIDE_POPULATION), WIDE_GENERATIONS
    generations, kept = max(1, generations // shorter), min(settings.elites, size - 1)
    return replace(settings, population=size, generations=generations, elites=kept)


def elites(run: Evolved, count: int) -> Array:
    """Return starts (count, G): spread over the last population, and the best of the first."""
    size = len(run.genes)
    last = min(size, (count + 1) // 2)
    spread = run.genes[np.linspace(0, size - 1, last).astype(int)]
    return np.concatenate([spread, run.first[: min(size, count - last)]])
