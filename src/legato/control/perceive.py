"""From a picture to the leg in the robot's frame: marks, calibration, transform, uncertainty.

The daemon's effect `Solve` and the command line's `solve` both call `find_leg`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from legato.calibration.degeneracy import Degeneracy, inspect
from legato.calibration.heldout import HeldOut, Suspects, held_out, suspects
from legato.calibration.problem import GENES, CalibrationError, Problem, Solution
from legato.calibration.solve import solve
from legato.control.effects import CellFault, Refused
from legato.control.settings import CellSettings
from legato.geometry.projection import project
from legato.geometry.transforms import Array
from legato.hal.camera import Image
from legato.hal.faults import Cause
from legato.vision.marks import MarksNotFound, Picking

Picks = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Calibration:
    """One picture's answer: what was seen, what was solved, and what speaks for and against it.

    `stations` (S, 3) and `normals` (S, 3) are the stations on the leg's top line and the surface
    normals there, in the robot base frame.
    """

    picking: Picking
    problem: Problem
    solution: Solution
    degeneracy: Degeneracy
    held_out: tuple[HeldOut, ...]
    suspects: Suspects
    world_from_object: Array
    stations: Array
    normals: Array


def find_marks_in(image: Image, settings: CellSettings, *, seed: int) -> Picking:
    """Return the marks of a picture; raises CellFault(marks_not_found)."""
    from legato.vision.pick import find_marks  # brings OpenCV, which the daemon starts without

    try:
        return find_marks(image, settings.leg, settings.nominal, seed=seed)
    except MarksNotFound as error:
        evidence = {"candidates": error.candidates}
        raise CellFault(Cause.MARKS_NOT_FOUND, error.text, error.hint, evidence) from error


def find_leg(
    image: Image, settings: CellSettings, *, seed: int, picks: Picks | None = None
) -> Calibration:
    """Find the leg in a picture, its marks picked by a person where `picks` are given.

    Raises MarksNotFound where the picture gives too few marks, CalibrationError where what it
    gives cannot be solved.
    """
    from legato.vision.pick import find_marks, snap_picks

    leg, nominal = settings.leg, settings.nominal
    if picks is None:
        picking = find_marks(image, leg, nominal, seed=seed)
    else:
        picking = snap_picks(image, leg, nominal, picks)
    return solve_marks(picking, settings, seed=seed)


def solve_marks(picking: Picking, settings: CellSettings, *, seed: int) -> Calibration:
    """Solve for camera and pose from marks; raises CalibrationError."""
    problem = _problem(picking, settings)
    rng = np.random.default_rng(seed)
    solution = solve(problem, settings.calibration.engine, settings.engine, rng, settings.leg.marks)
    left_out = held_out(problem, solution)
    world_from_object = settings.world_from_camera @ solution.camera_from_object
    places = np.array(settings.stations)
    rotation, origin = world_from_object[:3, :3], world_from_object[:3, 3]
    normal = rotation @ settings.leg.surface_normal()
    return Calibration(
        picking=picking,
        problem=problem,
        solution=solution,
        degeneracy=inspect(problem, settings.leg.marks),
        held_out=left_out,
        suspects=suspects(problem, solution, settings.engine, rng),
        world_from_object=world_from_object,
        stations=settings.leg.surface_point(places) @ rotation.T + origin,
        normals=np.tile(normal, (len(places), 1)),
    )


def perceive(image: Image, settings: CellSettings, *, seed: int) -> Calibration:
    """Do what `find_leg` does, with its errors as the cell's: a fault, or a refusal."""
    try:
        return solve_marks(find_marks_in(image, settings, seed=seed), settings, seed=seed)
    except CalibrationError as error:
        raise Refused(Cause.CALIBRATION_REJECTED, (str(error),)) from error


def disagreement(calibration: Calibration, second: Picking) -> tuple[float, int]:
    """Return how far (rms px) a second picture's marks lie from the prediction, and how many."""
    names = tuple(n for n in calibration.problem.names if n in second.marks)
    if not names:
        return float("inf"), 0
    points = calibration.problem.points[[calibration.problem.names.index(n) for n in names]]
    solution = calibration.solution
    seen = np.array([(second.marks[n].u, second.marks[n].v) for n in names])
    apart = project(solution.intrinsics, solution.camera_from_object, points) - seen
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=-1)))), len(names)


def _problem(picking: Picking, settings: CellSettings) -> Problem:
    """Return the calibration problem of the marks that are to be used."""
    wanted = settings.calibration.marks or settings.leg.names()
    names = tuple(n for n in wanted if n in picking.marks)
    found = [picking.marks[n] for n in names]
    free = settings.calibration.intrinsics == "free" or settings.calibration.engine == "paper"
    problem = Problem(
        names=names,
        points=settings.leg.points(names).reshape(-1, 3),
        pixels=np.array([(m.u, m.v) for m in found]).reshape(-1, 2),
        sigma=np.array([m.sigma for m in found]),
        bounds={g: getattr(settings.calibration.bounds, g) for g in GENES},
        known=None if free else settings.known,
        stations=settings.leg.surface_point(np.array(settings.stations)),
        size=(settings.nominal.width, settings.nominal.height),
    )
    return replace(problem, sigma=np.maximum(problem.sigma, settings.calibration.pixel_sigma))
