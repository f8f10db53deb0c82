"""`engine = "paper"`: the paper's genetic algorithm alone, eleven genes free within their bounds.

It ends at the best individual found, which is no optimum; its covariance is widened by its misfit,
so that what it does not reach shows in its sigmas. Known intrinsics are not used.
"""

from dataclasses import replace

import numpy as np

from legato.calibration.cost import POSE, cost, prepare
from legato.calibration.outcome import outcome
from legato.calibration.problem import EngineSettings, Problem, Solution
from legato.calibration.search import evolve
from legato.geometry.transforms import Array


def solve_paper(problem: Problem, settings: EngineSettings, rng: np.random.Generator) -> Solution:
    """Return the best of the paper's search (sections 3.1 to 3.3, stopped as in section 6)."""
    problem = replace(problem, known=None)
    model = prepare(problem)

    def price(genes: Array) -> Array:
        return cost(model, genes)

    run = evolve(price, model.search, model.wrap, settings, rng, watched=POSE)
    return outcome(
        problem,
        model,
        "paper",
        run.genes[0],
        float(run.cost[0]),
        agreement=float(np.mean(run.cost <= run.cost[0] * 1.01)),
        trace=run.trace,
        generations=run.generations,
        stopped_by="stalled" if run.stalled else "generations",
    )
