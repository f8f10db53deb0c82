"""The whole chain as a job runs it: capture, calibrate, verify, with given pictures."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.vision.scenes import Truth
from legato.calibration.problem import CalibrationError
from legato.control import effects as do
from legato.control.jobs import procedure
from legato.control.memory import Memory
from legato.control.perceive import Calibration, Picks, find_leg, find_marks_in, perceive
from legato.control.settings import CellSettings
from legato.geometry.transforms import angle_between
from legato.hal.camera import Frame, Image
from legato.hal.faults import Cause
from legato.vision.marks import MarksNotFound


@dataclass(frozen=True)
class Verdict:
    """Whether a leg's pose was accepted; else why not. The calibration even where refused."""

    accepted: bool
    reasons: tuple[str, ...]
    calibration: Calibration | None
    checks: tuple[dict[str, Any], ...] = ()

    def errors(self, truth: Truth) -> tuple[float, float]:
        """Return the pose's error in deg and its worst station's in mm, in the robot frame."""
        assert self.calibration is not None
        found = self.calibration.world_from_object
        turn = angle_between(found[:3, :3], truth.world_from_object[:3, :3])
        off = np.linalg.norm(self.calibration.stations - truth.stations(), axis=1)
        return float(np.degrees(turn)), float(off.max())


def verify(
    settings: CellSettings, first: Image, second: Image, picks: Picks | None = None
) -> Verdict:
    """Run capture, calibrate and verify as the daemon would, with these two pictures.

    Where a person gave `picks` they name the first picture's marks, as in `legato solve --picks`.
    """
    seed, memory = settings.calibration.seed, Memory()
    solved: list[Calibration] = []
    documents: list[Any] = []

    def result(effect: do.Effect, image: Image) -> Any:
        match effect:
            case do.Grab():
                return Frame(image, 0.0, 1, "bench")
            case do.Solve():
                solved.append(_solved(effect.frame.image, settings, seed, picks))
                return solved[-1]
            case do.Find():
                return find_marks_in(effect.frame.image, settings, seed=seed)
            case do.Save():
                documents.append(effect.document)
        return None

    reasons: tuple[str, ...] = ()
    try:
        for job, image in (("capture", first), ("calibrate", first), ("verify", second)):
            _perform(procedure(job, settings, memory, 0.0), image, result)
    except do.Refused as refusal:
        reasons = refusal.reasons
    except do.CellFault as fault:
        reasons = (fault.text,)
    checks = tuple(documents[-1]["checks"]) if documents else ()
    return Verdict(not reasons, reasons, solved[-1] if solved else None, checks)


def _solved(image: Image, settings: CellSettings, seed: int, picks: Picks | None) -> Calibration:
    if picks is None:
        return perceive(image, settings, seed=seed)
    try:
        return find_leg(image, settings, seed=seed, picks=picks)
    except (CalibrationError, MarksNotFound) as error:
        raise do.Refused(Cause.CALIBRATION_REJECTED, (str(error),)) from error


def _perform(work: Any, image: Image, result: Any) -> None:
    try:
        effect = next(work)
        while True:
            effect = work.send(result(effect, image))
    except StopIteration:
        return
