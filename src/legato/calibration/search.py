"""One generation after another: the loop that the paper's engine and the short searches share."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from legato.calibration.cost import Flags
from legato.calibration.operators import (
    crossover,
    difference,
    mutation,
    random_population,
    ranking,
    roulette,
)
from legato.calibration.problem import CalibrationError, EngineSettings, Trace
from legato.geometry.transforms import Array

Price = Callable[[Array], Array]  # genes (N, G) to costs (N,)


@dataclass(frozen=True)
class Evolved:
    """The last population (N, G) with costs (N,), best first, and how it came about.

    `first` (N, G) is the first population, best first: starts that share no ancestor.
    """

    genes: Array
    cost: Array
    first: Array
    trace: Trace
    generations: int
    stalled: bool


def evolve(
    price: Price,
    box: Array,
    wrap: Flags,
    settings: EngineSettings,
    rng: np.random.Generator,
    watched: slice,
) -> Evolved:
    """Run the genetic algorithm in the box (2, G) for at most `settings.generations`.

    It stops early, stalled, when the `watched` genes of the best individual stay within
    `stall_tolerance` of where they were for `stall_generations` (paper section 6).
    """
    n = settings.population
    chances = ranking(n, settings.ranking_pressure)
    genes = random_population(rng, n, box)
    genes, costs = _sorted(genes, price(genes))
    first = genes
    best, mean = [float(costs[0])], [_finite_mean(costs)]
    anchor, since = genes[0], 0
    for generation in range(1, settings.generations + 1):
        settings.heed()
        parents = roulette(rng, chances, n)
        children = crossover(rng, genes[parents], costs[parents], settings.crossover_rate, wrap)
        children = mutation(
            rng,
            children,
            box,
            generation / settings.generations,
            settings.mutation_rate,
            settings.mutation_scale,
            settings.mutation_horizon,
        )
        kept = settings.elites
        children[:kept] = genes[:kept]
        genes, costs = _sorted(children, price(children))
        best.append(float(costs[0]))
        mean.append(_finite_mean(costs))
        moved = np.abs(difference(anchor, genes[0], wrap))[watched]
        if moved.max() > settings.stall_tolerance:
            anchor, since = genes[0], generation
        elif generation - since >= settings.stall_generations:
            break
    trace = Trace(tuple(best), tuple(mean))
    stalled = len(best) - 1 < settings.generations
    return Evolved(genes, costs, first, trace, len(best) - 1, stalled)


def check_settings(settings: EngineSettings) -> None:
    """Raise CalibrationError for settings with which no search can run."""
    s = settings
    rules = (
        (s.population >= 2, f"population {s.population} is below 2"),
        (s.generations >= 1, f"generations {s.generations} is below 1"),
        (0 <= s.elites < s.population, f"elites {s.elites} must be fewer than the population"),
        (0.0 <= s.crossover_rate <= 1.0, f"crossover_rate {s.crossover_rate} is not in 0 to 1"),
        (0.0 <= s.mutation_rate <= 1.0, f"mutation_rate {s.mutation_rate} is not in 0 to 1"),
        (
            1.0 <= s.mutation_horizon <= 1.5,
            f"mutation_horizon {s.mutation_horizon} not in 1 to 1.5",
        ),
        (1.0 < s.ranking_pressure <= 2.0, f"ranking_pressure {s.ranking_pressure} is not 1 to 2"),
        (s.stall_generations >= 1, f"stall_generations {s.stall_generations} is below 1"),
        (s.search_population >= 2, f"search_population {s.search_population} is below 2"),
        (s.search_elites >= 1, f"search_elites {s.search_elites} is below 1"),
    )
    for fine, text in rules:
        if not fine:
            raise CalibrationError(text, "correct [calibration]")


def _sorted(genes: Array, costs: Array) -> tuple[Array, Array]:
    order = np.argsort(costs, kind="stable")
    return genes[order], costs[order]


def _finite_mean(costs: Array) -> float:
    """Return the mean of the finite among sorted costs; infinite where none is."""
    finite = int(np.searchsorted(costs, np.inf))
    return float(costs[:finite].mean()) if finite else float("inf")
