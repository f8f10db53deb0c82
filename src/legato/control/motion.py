"""The arm as a procedure moves it: where it stands, straight moves, the way back to safety.

Every method is a generator of effects to be used with `yield from`.
"""

from collections.abc import Callable, Generator
from typing import Any

import numpy as np

from legato.control.effects import CellFault, Effect, Move, ReadArm, Why
from legato.control.envelope import ROUNDING
from legato.control.memory import Memory
from legato.control.plan import pose_at, transit
from legato.control.settings import CellSettings
from legato.geometry.arm import Unreachable
from legato.geometry.motion import Steps, ToolPose, move_between, rounded, straight_path
from legato.geometry.transforms import Array
from legato.hal.arm import ArmReading
from legato.hal.faults import Cause

Procedure = Generator[Effect, Any, Any]
Lift = Callable[[ToolPose], ToolPose]
PIECE_S = 0.19  # s that one piece of a slow move lasts
IN_THE_AIR = (Why.TRANSIT, Why.APPROACH)


class Track:
    """Where the arm stands in absolute steps, by its own registers, and the pose to retreat to.

    `lift` gives the pose to retreat to from where the fingertip is at the leg; None while it is
    not. `touching` are the stations between which it may touch. `fresh` says whether the last
    reading is of this moment: a motion has just ended with it.
    """

    def __init__(self, settings: CellSettings, memory: Memory) -> None:
        self._settings = settings
        self._memory = memory
        self.lift: Lift | None = None
        self.touching: tuple[float, float | None] | None = None
        self.contact = False
        self.fresh = False

    @property
    def steps(self) -> Steps:
        """Absolute steps now; the arm is referenced whenever a procedure moves it."""
        steps = self._memory.steps()
        if steps is None:
            raise CellFault(
                Cause.LIMIT, "the arm's position is not known", "reference the arm, then try again"
            )
        return steps

    @property
    def pose(self) -> ToolPose:
        """The fingertip's pose now, from the registers."""
        return pose_at(self._settings, self.steps)

    def read(self) -> Procedure:
        """Read registers and switch."""
        self._take((yield ReadArm()))

    def look(self) -> Procedure:
        """Read registers and switch where the last motion's own reading does not tell them."""
        if not self.fresh:
            yield from self.read()

    def to(self, goal: ToolPose, why: Why, speed: float | None = None) -> Procedure:
        """Move in a straight line to a pose, at most at `speed` mm/s; descents end on contact.

        A switch that closes in the air ends in CellFault(contact_early), after the way back.
        """
        if why in IN_THE_AIR:
            yield from self.look()
        here, scale = self.pose, self._settings.speed_scale
        length = float(np.linalg.norm(goal.xyz - here.xyz))
        pieces = 1 if speed is None else max(1, int(np.ceil(length / (speed * PIECE_S))))
        try:
            path = straight_path(
                self._settings.arm, here, goal, scale=scale, pieces=pieces, tolerance=ROUNDING
            )
        except Unreachable as error:
            raise CellFault(
                Cause.LIMIT, f"the way is out of reach: {error}", "move the leg into reach"
            ) from error
        for target in rounded(path, self._settings.arm.grip_per_elbow):
            start = self.steps
            if start == target:
                continue
            least = 0.0 if speed is None else length / (speed * len(path))
            move = move_between(self._settings.arm, start, target, scale, least)
            station, until = self.touching or (None, None)
            closed = self.contact and why is Why.TRANSIT  # who was at the leg may leave it
            self._take((yield Move(move, start, target, why, station, until)))
            if why is Why.DESCEND and self.contact:
                return
            if why in IN_THE_AIR and self.contact and not closed:
                at = self.pose.xyz
                yield from self.to(here, Why.RETRACT)
                raise _touched(at)

    def travel(self, goal: ToolPose) -> Procedure:
        """Go to a pose by the transit: up to the height of home, across, down."""
        for pose in transit(self._settings, self.pose, goal):
            yield from self.to(pose, Why.TRANSIT)

    def retreat(self) -> Procedure:
        """Go back up to the approach height where the fingertip is at the leg; else nothing."""
        if self.lift is not None:
            yield from self.to(self.lift(self.pose), Why.RETRACT)
            self.lift = self.touching = None

    def _take(self, reading: ArmReading) -> None:
        self._memory.registers = reading.registers
        self.contact = reading.contact
        self.fresh = True


def _touched(at: Array) -> CellFault:
    """Return the fault of a switch that closed at `at` (3,), where nothing should be."""
    place = ", ".join(f"{v:.0f}" for v in at)
    return CellFault(
        Cause.CONTACT_EARLY,
        f"the switch closed on the way, with the fingertip at ({place}) mm by the registers",
        "see what it touched and that the switch is free; if nothing is in the way, the arm does "
        "not stand where it was referenced: reference it anew",
        {"xyz_mm": [round(float(v), 1) for v in at]},
    )
