"""What marks can tell and what they cannot: residuals against errors, sets against sets."""

import numpy as np

from docs.gen.figures.canvas import BLUE, GREEN, ORANGE, RED, SMALL, SOFT, dressed, sheet, svg
from docs.gen.figures.scene import ALL, BEST_SEVEN, COPLANAR, SIX_AND_ONE, Scene, scene
from legato.calibration.cost import prepare
from legato.calibration.problem import Problem, pose_of
from legato.calibration.refine import refine
from legato.calibration.uncertainty import covariance_of, station_sigmas
from legato.geometry.transforms import Array, apply

DRAWS, STARTS, SIGMA = 16, 8, 0.25


def residuals() -> str:
    """Return residual against true error of every fit that explains the picture, camera free."""
    figure = sheet(3.0)
    axes = dressed(figure.add_subplot(), "residual rms, px", "worst station off by, mm")
    cell = scene()
    sets = ((COPLANAR, RED, "eight in one plane", "o"), (SIX_AND_ONE, ORANGE, "six and one", "^"),
            (BEST_SEVEN, BLUE, "best seven", "s"))  # fmt: skip
    for names, colour, label, mark in sets:
        rms, off = fits(cell, names)
        axes.plot(rms, off, mark, color=colour, markersize=4, label=label, alpha=0.85)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlim(0.0, 0.45)
    legend = axes.legend(loc="upper right", fontsize=SMALL, frameon=False)
    for text in legend.get_texts():
        text.set_color(SOFT)
    return svg(figure, "residuals")


def fits(cell: Scene, names: tuple[str, ...]) -> tuple[Array, Array]:
    """Return rms (px) and worst station error (mm) of fits whose cost is that of the best.

    Each picture is fitted from the truth and from starts about it: the pose by 20 deg and 40 mm,
    the camera anywhere in its bounds.
    """
    rng = np.random.default_rng(5)
    rms, off = [], []
    for _ in range(DRAWS):
        problem = cell.problem(names, SIGMA, rng)
        model = prepare(problem)
        starts = np.tile(cell.genes, (STARTS, 1))
        low, high = model.search[:, :5]
        starts[1:, :5] = rng.uniform(low, high, (STARTS - 1, 5))
        starts[1:, 5:8] += rng.uniform(-40.0, 40.0, (STARTS - 1, 3))
        starts[1:, 8:] += rng.uniform(-0.35, 0.35, (STARTS - 1, 3))
        found = refine(model, np.clip(starts, *model.search), rounds=60)
        for k in np.flatnonzero(found.cost <= 1.05 * found.cost.min() + 1e-3):
            rms.append(np.sqrt(float(found.cost[k]) / (2 * len(names))))
            off.append(_error(problem, found.genes[k], cell))
    return np.array(rms), np.array(off)


def _error(problem: Problem, genes: Array, cell: Scene) -> float:
    """Return how far the worst station lies off, mm."""
    there = apply(pose_of(genes), problem.stations)
    true = apply(cell.camera_from_object, problem.stations)
    return float(np.linalg.norm(there - true, axis=1).max())


def bound() -> str:
    """Return the worst station's predicted deviation for sets of marks, camera free and known."""
    figure = sheet(2.7, left=2.05)
    axes = dressed(figure.add_subplot(), "predicted standard deviation of the worst station, mm")
    sets = (("ten marks", ALL), ("best seven", BEST_SEVEN), ("six and one", SIX_AND_ONE))
    rows = []
    for label, names in sets:
        for known, what in ((False, "camera free"), (True, "camera known")):
            rows.append((f"{label}, {what}", worst(scene(), names, known=known), known))
    for at, (_, value, known) in enumerate(reversed(rows)):
        colour = GREEN if known else ORANGE
        axes.barh(at, value, color=colour, height=0.62)
        axes.text(value * 1.12, at, f"{value:.2g}", color=SOFT, fontsize=SMALL, va="center")
    axes.set_yticks(range(len(rows)), [label for label, _, _ in reversed(rows)])
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlim(0.02, 60)
    axes.axvline(0.3, color=RED, linewidth=1)
    axes.text(0.32, len(rows) - 0.5, "verify's limit", color=RED, fontsize=SMALL, va="bottom")
    axes.set_ylim(-0.6, len(rows) + 0.1)
    axes.grid(axis="y", visible=False)
    return svg(figure, "bound")


def worst(cell: Scene, names: tuple[str, ...], *, known: bool, sigma: float = SIGMA) -> float:
    """Return the worst station's predicted standard deviation at the truth, mm."""
    problem = cell.problem(names, sigma, known=known)
    genes = cell.genes.copy()
    if known:
        genes[:3] = 1.0, cell.camera.alpha_u, cell.camera.alpha_v
    covariance = covariance_of(problem, prepare(problem), genes)
    return float(station_sigmas(covariance, genes, problem.stations).max())
