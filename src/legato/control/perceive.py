"""From a picture to the leg in the robot's frame: marks, calibration, transform, uncertainty.

The daemon's effect `Solve` and the command line's `solve` both call `find_leg`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from legato.calibration.degeneracy import Degeneracy, inspect
from legato.calibration.heldout import HeldOut, Suspects, held_out
from legato.calibration.problem import GENES, CalibrationError, Problem, Solution
from legato.calibration.robust import Robust, solve_robust
from legato.control.effects import CellFault, Refused
from legato.control.settings import CellSettings
from legato.geometry.projection import pinhole_pixels
from legato.geometry.transforms import Array
from legato.hal.camera import Image
from legato.hal.faults import Cause
from legato.vision.marks import MarksNotFound, Picking

Picks = Mapping[str, tuple[float, float]]

DAY_S = 86_400.0
CLOCKS_DIFFER_DAYS = 1.0  # two clocks and their zones may differ by so much
LENS_ROUNDS = 5
LENS_CLOSE = 1e-3  # px


@dataclass(frozen=True)
class Calibration:
    """One picture's answer: what was seen, what was solved, and what speaks for and against it.

    `problem` is what was solved: without the marks `left_out`, and with free intrinsics in pixels
    freed of the lens's known distortion. `stations` (S, 3) and `normals` (S, 3) are the stations on
    the leg's top line and the surface normals there, in the robot base frame.
    """

    picking: Picking
    problem: Problem
    solution: Solution
    degeneracy: Degeneracy
    held_out: tuple[HeldOut, ...]
    suspects: Suspects
    left_out: tuple[str, ...]
    world_from_object: Array
    stations: Array
    normals: Array


def find_marks_in(
    image: Image, settings: CellSettings, *, seed: int, picks: Picks | None = None
) -> Picking:
    """Return the marks of a picture; raises CellFault(marks_not_found)."""
    try:
        return pick_marks(image, settings, seed=seed, picks=picks)
    except MarksNotFound as error:
        evidence = {"candidates": error.candidates}
        raise CellFault(Cause.MARKS_NOT_FOUND, error.text, error.hint, evidence) from error


def pick_marks(
    image: Image, settings: CellSettings, *, seed: int, picks: Picks | None = None
) -> Picking:
    """Return the marks of a picture, snapped to `picks` where a person gave some.

    Raises MarksNotFound where the picture gives too few.
    """
    from legato.vision.pick import find_marks, snap_picks

    if picks is not None:
        return snap_picks(image, settings.leg, settings.nominal, picks)
    return find_marks(image, settings.leg, settings.nominal, seed=seed)


def find_leg(
    image: Image, settings: CellSettings, *, seed: int, picks: Picks | None = None
) -> Calibration:
    """Find the leg in a picture, its marks picked by a person where `picks` are given.

    Raises MarksNotFound where the picture gives too few marks, CalibrationError where what it
    gives cannot be solved.
    """
    return solve_marks(pick_marks(image, settings, seed=seed, picks=picks), settings, seed=seed)


def solve_marks(picking: Picking, settings: CellSettings, *, seed: int) -> Calibration:
    """Solve for camera and pose from marks; raises CalibrationError.

    One or two marks that beyond doubt are wrong are left out.
    """
    rng = np.random.default_rng(seed)
    found = _solved(problem_of(picking, settings), settings, rng)
    problem, solution = found.problem, found.solution
    world_from_object = settings.world_from_camera @ solution.camera_from_object
    places = np.array(settings.stations)
    rotation, origin = world_from_object[:3, :3], world_from_object[:3, 3]
    normal = rotation @ settings.leg.surface_normal()
    return Calibration(
        picking=picking,
        problem=problem,
        solution=solution,
        degeneracy=inspect(problem, settings.leg.marks),
        held_out=held_out(problem, solution),
        suspects=found.suspects,
        left_out=found.left_out,
        world_from_object=world_from_object,
        stations=settings.leg.surface_point(places) @ rotation.T + origin,
        normals=np.tile(normal, (len(places), 1)),
    )


def _solved(problem: Problem, settings: CellSettings, rng: np.random.Generator) -> Robust:
    """Return the solution; free intrinsics keep the nominal camera's distortion."""
    table, marks, camera = settings.calibration, settings.leg.marks, settings.nominal
    if problem.known is not None or not (camera.k1 or camera.k2):
        return solve_robust(problem, table.engine, settings.engine, rng, marks)
    seen = problem.pixels
    for _ in range(LENS_ROUNDS):
        # The distortion depends on the camera that is sought: begin with the nominal one.
        straight = pinhole_pixels(camera, seen)
        found = solve_robust(
            replace(problem, pixels=straight), table.engine, settings.engine, rng, marks
        )
        found_camera = replace(found.solution.intrinsics, k1=camera.k1, k2=camera.k2)
        moved = np.abs(pinhole_pixels(found_camera, seen) - straight).max(initial=0.0)
        camera = found_camera
        if moved < LENS_CLOSE:
            break
    return replace(found, solution=replace(found.solution, intrinsics=camera))


def refuse_outdated(settings: CellSettings, now_s: float) -> None:
    """Raise CalibrationError where the known intrinsics are older than the cell lets them be.

    `now_s` is the time of day in s since 1970.
    """
    if settings.camera_dated_s is None:
        return
    days = (now_s - settings.camera_dated_s) / DAY_S
    if days < -CLOCKS_DIFFER_DAYS:
        text = f"the intrinsics file is dated {-days:.0f} days from now"
        raise CalibrationError(text, "set this machine's clock, or calibrate the camera anew")
    if days > settings.camera_days:
        text = (
            f"the intrinsics file is {days:.0f} days old, {settings.camera_days:g} are allowed "
            "(camera.max_intrinsics_age_days)"
        )
        hint = "calibrate the camera anew (legato intrinsics): mounts creep and lenses are touched"
        raise CalibrationError(text, hint)


def perceive(
    image: Image,
    settings: CellSettings,
    *,
    seed: int,
    picks: Picks | None = None,
    now_s: float | None = None,
) -> Calibration:
    """Do what `find_leg` does, with its errors as the cell's: a fault, or a refusal.

    Where the time of day is given the known intrinsics must not be older than they may be.
    """
    try:
        if now_s is not None:
            refuse_outdated(settings, now_s)
        picking = find_marks_in(image, settings, seed=seed, picks=picks)
        return solve_marks(picking, settings, seed=seed)
    except CalibrationError as error:
        raise Refused(Cause.CALIBRATION_REJECTED, (str(error),)) from error


def problem_of(picking: Picking, settings: CellSettings) -> Problem:
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
