"""From the best genes to a Solution: observables, covariance, sigmas, agreement and bounds met."""

from dataclasses import replace

import numpy as np

from legato.calibration.cost import Model, prepare, residuals, split_alphas, tied
from legato.calibration.problem import GENES, CalibrationError, Problem, Solution, Trace, pose_of
from legato.calibration.refine import Refined
from legato.calibration.uncertainty import (
    covariance_of,
    misfit,
    noise_limit,
    root_trace,
    station_sigmas,
    widening,
)
from legato.geometry.projection import Intrinsics, project
from legato.geometry.transforms import Array


def agreement(refined: Refined) -> float:
    """Return the share (0 to 1) of refined starts that reached the best optimum.

    Those that were broken off are not counted: where they would have ended is not known.
    """
    ended = ~refined.unfinished
    return float(refined.at_best()[ended].mean()) if ended.any() else 0.0


def outcome(
    problem: Problem,
    model: Model,
    engine: str,
    genes: Array,
    value: float,
    agreement: float,
    trace: Trace,
    generations: int,
    stopped_by: str,
) -> Solution:
    """Return the Solution that genes (11,) with cost `value` px^2 stand for.

    Raises CalibrationError for a cost that is not finite.
    """
    if not np.isfinite(value):
        raise CalibrationError(
            "no pose within the bounds has every mark before the camera",
            "widen the bounds of t_x, t_y, t_z",
        )
    if problem.known is None:
        genes = _centred(genes, model)
    camera = intrinsics_of(problem, genes)
    place = pose_of(genes)
    covariance = covariance_of(problem, model, genes) * widening(*misfit(model, genes))
    off = residuals(model, genes[None])[0] * model.weights[:, None]
    return Solution(
        engine=engine,
        names=problem.names,
        genes=genes,
        intrinsics=camera,
        camera_from_object=place,
        cost=value,
        rms_px=float(np.sqrt(np.mean(off**2))),
        residuals=project(camera, place, problem.points) - problem.pixels,
        covariance=covariance,
        sigma_rotation=float(root_trace(covariance[4:7, 4:7])),
        sigma_translation=float(root_trace(covariance[7:, 7:])),
        sigma_stations=station_sigmas(covariance, genes, problem.stations),
        agreement=agreement,
        on_bound=on_bound(model, genes),
        trace=trace,
        generations=generations,
        stopped_by=stopped_by,
    )


def intrinsics_of(problem: Problem, genes: Array) -> Intrinsics:
    """Return the camera of genes (11,); distortion and size are the known ones."""
    lens = (0.0, 0.0, *problem.size)
    if problem.known is not None:
        i = problem.known.intrinsics
        lens = (i.k1, i.k2, i.width, i.height)
    f, s_x, s_y, u0, v0 = (float(g) for g in genes[:5])
    return Intrinsics(f * s_x, f * s_y, u0, v0, *lens)


def on_bound(model: Model, genes: Array) -> tuple[str, ...]:
    """Return the genes that sit on a bound of the refinement's box, save those held fixed."""
    low, high = model.box
    with np.errstate(invalid="ignore"):
        margin = 1e-9 * np.where(np.isfinite(high - low), high - low, 1.0)
    genes = tied(model, genes[None])[0]
    met = (high > low) & ((genes <= low + margin) | (genes >= high - margin))
    return tuple(GENES[i] for i in np.flatnonzero(met))


def _centred(genes: Array, model: Model) -> Array:
    """Return genes with f, s_x, s_y off their bounds wherever the same alphas allow it."""
    low, high = model.search[:, :3]
    if (((genes[:3] > low) & (genes[:3] < high)) | (low == high)).all():
        return genes
    alphas = genes[None, :1] * genes[None, 1:3]
    return np.concatenate([split_alphas(alphas, model.search)[0], genes[3:]])


def goodness(problem: Problem, solution: Solution) -> tuple[float, float]:
    """Return the chi-square of a solution and the most that noise makes of it (one in 1,000)."""
    if solution.engine == "paper":
        problem = replace(problem, known=None)
    value, freedom = misfit(prepare(problem), solution.genes)
    return value, noise_limit(freedom)
