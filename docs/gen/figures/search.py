"""How the genetic search goes: cost by generation, the size of mutations, ranks."""

import numpy as np

from docs.gen.figures.canvas import BLUE, GREEN, ORANGE, SMALL, SOFT, dressed, sheet, svg
from docs.gen.figures.scene import BEST_SEVEN, scene
from legato.calibration.operators import ranking
from legato.calibration.paper import solve_paper
from legato.calibration.problem import EngineSettings
from legato.calibration.solve import solve

GENERATIONS = 300


def convergence() -> str:
    """Return the cost by generation of the paper's search, and what refinement reaches."""
    cell = scene()
    problem = cell.problem(BEST_SEVEN, 0.25, np.random.default_rng(2))
    settings = EngineSettings(generations=GENERATIONS, stall_generations=GENERATIONS)
    figure = sheet(2.8)
    axes = dressed(figure.add_subplot(), "generation", "cost, px²")
    for seed in range(3):
        trace = solve_paper(problem, settings, np.random.default_rng(seed)).trace
        axes.plot(trace.best, color=BLUE, linewidth=1.3, alpha=0.9)
    best = solve(problem, "hybrid", EngineSettings(), np.random.default_rng(0))
    axes.axhline(best.cost, color=GREEN, linewidth=1.4)
    axes.axvline(15, color=ORANGE, linewidth=1, linestyle=(0, (4, 3)))
    axes.set_yscale("log")
    axes.set_ylim(best.cost / 3, 3e6)
    axes.set_xlim(0, GENERATIONS)
    right = GENERATIONS * 0.985
    axes.text(right, best.cost * 1.25, "after refinement", color=GREEN, fontsize=SMALL, ha="right")
    axes.text(19, 1.6e6, "hybrid ends its search here", color=ORANGE, fontsize=SMALL)
    axes.text(right, 6e3, "best of 200, three seeds", color=BLUE, fontsize=SMALL, ha="right")
    return svg(figure, "convergence")


def operators() -> str:
    """Return the share of the way to a bound that a mutation goes, and who is chosen how often."""
    figure = sheet(2.6, between=0.32)
    left, right = figure.subplots(1, 2)
    dressed(left, "share of all generations, t / T", "share of the way to the bound")
    progress = np.linspace(0.0, 1.0, 101)
    for quantile, style in ((0.9, (0, (2, 2))), (0.5, "-"), (0.1, (0, (2, 2)))):
        share = 1.0 - (1.0 - quantile) ** np.maximum(1.0 - progress, 0.0)
        left.plot(progress, share, color=BLUE, linestyle=style, linewidth=1.4)
    left.text(0.03, 0.93, "one in ten goes further", color=SOFT, fontsize=SMALL)
    left.text(0.03, 0.55, "median", color=BLUE, fontsize=SMALL)
    left.set_xlim(0, 1)
    left.set_ylim(0, 1)
    dressed(right, "rank, best first", "chance of being chosen, %")
    for pressure, colour in ((2.0, BLUE), (1.5, ORANGE), (1.1, GREEN)):
        chance = 100 * ranking(200, pressure)
        right.plot(chance, color=colour, linewidth=1.4)
        right.text(4, chance[0] + 0.02, f"η = {pressure:g}", color=colour, fontsize=SMALL)
    right.set_xlim(0, 200)
    right.set_ylim(0, 1.15)
    return svg(figure, "operators")
