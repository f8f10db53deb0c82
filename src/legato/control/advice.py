"""Which marks to use and which to show as well: what a person can do about a poor picture."""

from dataclasses import dataclass, replace

import numpy as np

from legato.calibration.cost import prepare
from legato.calibration.degeneracy import inspect
from legato.calibration.problem import CalibrationError, Problem
from legato.calibration.solve import LEAST_FREE, LEAST_KNOWN
from legato.calibration.suggest import suggest
from legato.calibration.uncertainty import covariance_of, station_sigmas
from legato.control.perceive import Calibration, problem_of
from legato.control.settings import CellSettings
from legato.geometry.projection import project
from legato.vision.marks import Picking

BEST = 7  # marks of the suggested set
WORTH = 0.95  # a mark is worth adding that brings the worst station's sigma below this share
LEAST_INSPECTED = 4  # marks that can be looked at for a common plane


@dataclass(frozen=True)
class Advice:
    """The best set of the marks there are, those worth showing as well, and why they are wanted.

    `use` is empty where no pose is known to judge by, `why` where nothing is amiss.
    """

    use: tuple[str, ...]
    add: tuple[str, ...]
    why: str = ""


def advise_marks(picking: Picking, settings: CellSettings) -> Advice:
    """Return what the marks alone tell, before anything is solved."""
    names, found = settings.leg.names(), picking.marks
    missing = tuple(n for n in names if n not in found)
    problem = problem_of(picking, settings)
    least = LEAST_FREE if problem.known is None else LEAST_KNOWN
    if len(problem.names) >= LEAST_INSPECTED:
        report = inspect(problem, settings.leg.marks)
        why = report.refused or "; ".join(report.warnings)
        if why:
            return Advice((), report.add, why)
    if len(problem.names) < least:
        why = f"{len(problem.names)} marks are too few, {least} are needed"
        return Advice((), missing, why)
    return Advice((), missing)


def advise(calibration: Calibration, settings: CellSettings) -> Advice:
    """Return the best seven of the marks used, and the missing ones that would tell most.

    `add` is ordered by how much each would lower the worst station's standard deviation.
    """
    problem, genes = calibration.problem, calibration.solution.genes
    best = problem.names
    if len(problem.names) > BEST:
        try:
            best = suggest(problem, genes, BEST)
        except CalibrationError:
            best = ()
    now = _worst_sigma(problem, calibration)
    gains = {}
    for name in settings.leg.names():
        if name not in problem.names:
            gains[name] = _worst_sigma(_with(problem, name, calibration, settings), calibration)
    worthy = sorted((n for n in gains if gains[n] < WORTH * now), key=lambda n: gains[n])
    report = calibration.degeneracy
    why = report.refused or "; ".join(report.warnings)
    if not why and worthy:
        first = worthy[0]
        reason = calibration.picking.missing.get(first, "it was not used")
        why = (
            f"with {first} the worst station would be known to {gains[first]:.3f} mm rather than "
            f"{now:.3f} mm ({first}: {reason})"
        )
    wanted = report.add if report.refused or report.warnings else tuple(worthy)
    return Advice(best, wanted, why)


def _worst_sigma(problem: Problem, calibration: Calibration) -> float:
    """Return the worst station's standard deviation (mm) that a problem's marks allow."""
    genes = calibration.solution.genes
    covariance = covariance_of(problem, prepare(problem), genes)
    return float(station_sigmas(covariance, genes, problem.stations).max(initial=0.0))


def _with(problem: Problem, name: str, calibration: Calibration, settings: CellSettings) -> Problem:
    """Return the problem with one more mark, as if seen where the pose puts it."""
    point = settings.leg.points((name,))
    camera = calibration.solution.intrinsics
    pixel = project(camera, calibration.solution.camera_from_object, point)
    return replace(
        problem,
        names=(*problem.names, name),
        points=np.concatenate([problem.points, point]),
        pixels=np.concatenate([problem.pixels, pixel]),
        sigma=np.append(problem.sigma, np.median(problem.sigma)),
    )
