"""Arm and camera with what is known of them. The worker's thread alone uses this.

An arm is referenced as long as its registers are what they were when it last was: whatever else
they read, nobody knows where it stands.
"""

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from legato.control.settings import CellSettings
from legato.daemon.cell import Cell
from legato.daemon.messages import View
from legato.geometry.arm import forward, joints_from_steps, reach, steps_from_joints
from legato.geometry.motion import StepMove, Steps, ToolPose, rounded
from legato.hal.arm import ArmReading
from legato.hal.camera import Frame
from legato.hal.faults import Cause, DeviceError

if TYPE_CHECKING:
    from legato.control.memory import Memory

GONE = (Cause.ARM_LOST, Cause.ARM_TIMEOUT)


class Devices:
    """The open devices and the memory of the cell. Times are the cell's, in s."""

    def __init__(self, cell: Cell, settings: CellSettings, memory: "Memory") -> None:
        self.cell = cell
        self.memory = memory
        self.solved: tuple[Frame, float] | None = None
        self.calibrated_at: float | None = None
        self.calibrated_in: str | None = None
        self._settings = settings
        self._arm_connected = False
        self._camera_connected = False
        self._contact: bool | None = None
        self._picture_at: float | None = None

    def open(self) -> list[DeviceError]:
        """Open what is not open; return the errors of what is missing. Moves nothing."""
        problems = []
        for connect in (self._open_arm, self._open_camera):
            try:
                connect()
            except DeviceError as error:
                problems.append(error)
        return problems

    def reopen(self) -> None:
        """Open both anew where they do not answer; tries both, then raises the first error."""
        if self._arm_connected:
            self._try_arm()
        if self._camera_connected:
            self._try_camera()
        problems = self.open()
        if problems:
            raise problems[0]

    @property
    def complete(self) -> bool:
        """Whether both answered when last asked."""
        return self._arm_connected and self._camera_connected

    def look(self) -> None:
        """Read the arm where it is connected; finding it gone or changed is no error here."""
        if self._arm_connected:
            self._try_arm()

    def read(self) -> ArmReading:
        """Return registers and switch. Raises DeviceError, after which the arm counts as gone."""
        try:
            reading = self.cell.arm.read()
        except DeviceError:
            self._arm_connected = False
            raise
        self._take(reading)
        return reading

    def step(self, move: StepMove) -> ArmReading:
        """Carry out one motion command. Raises DeviceError; then the position may be in doubt."""
        try:
            reading = self.cell.arm.step(move)
        except BaseException as error:
            if self.cell.arm.position_in_doubt:
                self.memory.reference = None
            if isinstance(error, DeviceError) and error.cause in GONE:
                self._arm_connected = False
            raise
        self._contact, self.memory.registers = reading.contact, reading.registers
        return reading

    def grab(self) -> Frame:
        """Return a picture, from a camera that counts as gone after opening it anew.

        Raises DeviceError, after which the camera counts as gone.
        """
        self._open_camera()
        try:
            frame = self.cell.camera.grab()
        except DeviceError:
            self._camera_connected = False
            raise
        self._picture_at = self.cell.clock.monotonic() - frame.age_s
        return frame

    def reference(self, pose: ToolPose) -> None:
        """Take the arm to stand at `pose`, its registers zeroed there.

        Raises geometry.arm.Unreachable for a pose that the arm cannot have, DeviceError.
        """
        steps = steps_of(self._settings, pose)
        self.memory.reference = None
        self.cell.arm.zero()
        self.memory.registers = None
        self.read()
        self.memory.reference = steps

    def doubt(self) -> None:
        """Forget where the arm stands."""
        self.memory.reference = None

    def close(self) -> None:
        """Let go of both; tries both, then raises the first error."""
        first: Exception | None = None
        for device in (self.cell.arm, self.cell.camera):
            try:
                device.close()
            except Exception as error:  # noqa: BLE001  # the other must be closed all the same
                first = first or error
        self._arm_connected = self._camera_connected = False
        if first is not None:
            raise first

    def view(self) -> View:
        """Return a copy of all that is known."""
        return View(
            arm=self._arm(),
            camera_connected=self._camera_connected,
            picture_at=self._picture_at,
            calibrated_at=self.calibrated_at,
            calibrated_in=self.calibrated_in,
            memory=replace(self.memory),
        )

    def _arm(self) -> dict[str, Any]:
        steps = self.memory.steps()
        arm: dict[str, Any] = {
            "connected": self._arm_connected,
            "referenced": steps is not None,
            "xyz_mm": None,
            "pitch_deg": None,
            "roll_deg": None,
            "contact": self._contact if self._arm_connected else None,
        }
        if steps is not None:
            joints, _ = joints_from_steps(self._settings.arm, steps)
            xyz, pitch, roll = forward(self._settings.arm, joints)
            arm["xyz_mm"] = [round(float(v), 3) for v in xyz]
            arm["pitch_deg"] = round(float(np.degrees(pitch)), 3)
            arm["roll_deg"] = round(float(np.degrees(roll)), 3)
        return arm

    def _open_arm(self) -> None:
        if self._arm_connected:
            return
        arm = self.cell.arm
        try:
            arm.open()
        except DeviceError:
            arm.close()
            raise
        self.read()
        self._arm_connected = True
        fresh = self.memory.registers == (0, 0, 0, 0, 0, 0)
        if self.cell.stands_at is not None and fresh and self.memory.reference is None:
            self.reference(self.cell.stands_at)

    def _open_camera(self) -> None:
        if self._camera_connected:
            return
        self.cell.camera.close()
        self.cell.camera.open()
        self._camera_connected = True

    def _try_arm(self) -> None:
        try:
            self.read()
        except DeviceError:
            self.cell.arm.close()

    def _try_camera(self) -> None:
        with suppress(DeviceError):
            self.grab()

    def _take(self, reading: ArmReading) -> None:
        """Keep a reading; registers that changed by themselves put the position in doubt."""
        known = self.memory.registers
        if known is not None and known != reading.registers:
            self.memory.reference = None
        self._contact, self.memory.registers = reading.contact, reading.registers


def steps_of(settings: CellSettings, pose: ToolPose) -> Steps:
    """Return the absolute steps of a pose; raises geometry.arm.Unreachable."""
    joints = reach(settings.arm, pose.xyz, pose.pitch, pose.roll)
    (whole,) = rounded(
        steps_from_joints(settings.arm, joints, pose.grip)[None], settings.arm.grip_per_elbow
    )
    one, two, three, four, five, six = (int(v) for v in whole)
    return one, two, three, four, five, six
