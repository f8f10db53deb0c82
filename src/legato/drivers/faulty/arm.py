"""An arm that goes wrong on schedule. What it tells is what a real arm's driver would tell.

Motions that are missed, broken off or carried out without an answer are so for the arm behind it
too: the world agrees with the fault.
"""

from collections.abc import Iterable
from dataclasses import replace
from math import ceil
from typing import NoReturn

from legato.drivers.faulty.script import Script
from legato.drivers.faulty.settings import STUCK, FaultSettings
from legato.geometry.motion import SPEED_ZERO, SPEEDS, StepMove, Steps
from legato.hal.arm import Arm, ArmReading, Traced, Witness
from legato.hal.clock import Clock
from legato.hal.faults import Cause, DeviceError

ENDS = ("arm_lost", "arm_timeout", "arm_refused", "arm_stopped_by_pendant")
TEXTS = {
    "arm_lost": ("the line to the arm is gone", "see that it is on and plugged in"),
    "arm_timeout": ("the arm has not answered in time", "see the arm and its cable"),
    "arm_refused": ("the arm has refused the command", "see the arm's own panel"),
    "arm_stopped_by_pendant": (
        "STOP was pressed on the arm's pendant",
        "see why, then reset and reference the arm",
    ),
}


class FaultyArm:
    """An arm around another; without a fault that strikes it is that other."""

    def __init__(self, arm: Arm, faults: Iterable[FaultSettings], clock: Clock) -> None:
        self._arm = arm
        self._script = Script(faults, clock)
        self._in_doubt = False
        self._to_miss = {"following_error": [0] * 6, "lost_steps": [0] * 6}
        self._hidden = [0] * 6  # half-steps that the registers count and the arm has not done
        self._stuck: dict[str, float] = {}  # until when

    @property
    def simulated(self) -> bool:
        """Whether no real arm moves."""
        return self._arm.simulated

    @property
    def position_in_doubt(self) -> bool:
        """Whether registers and arm may disagree, from a broken-off motion until `zero`."""
        return self._in_doubt or self._arm.position_in_doubt

    def open(self) -> None:
        """Connect, unless a fault lasts that keeps the arm from answering."""
        for fault in self._script.struck_by("open"):
            if fault.kind in ("arm_lost", "arm_timeout", "arm_refused"):
                self._fail(fault)
            self._begin(fault)
        self._arm.open()

    def close(self) -> None:
        """Let go of the port."""
        self._arm.close()

    def read(self) -> ArmReading:
        """Return registers and switch now."""
        struck = self._script.struck_by("read")
        for fault in struck:
            if fault.kind in ENDS:
                self._fail(fault)
            self._begin(fault)
        return self._told(self._arm.read(), struck)

    def step(self, move: StepMove) -> ArmReading:
        """Carry out one motion command as far as the faults let it."""
        struck = self._script.struck_by("step")
        for fault in struck:
            if fault.kind in ENDS:
                self._break_off(fault, move)
            self._begin(fault)
        return self._told(self._arm.step(self._sent(move)), struck)

    def zero(self) -> None:
        """Zero the position registers where the arm stands."""
        for fault in self._script.struck_by("zero"):
            if fault.kind in ENDS:
                self._fail(fault)
            self._begin(fault)
        self._arm.zero()
        self._in_doubt = False
        self._hidden = [0] * 6

    def _begin(self, fault: FaultSettings) -> None:
        """Take in a fault that does not end the call."""
        now = self._script.clock.monotonic()
        if fault.kind == "arm_blocks":
            self._script.clock.sleep(fault.size)
        elif fault.kind in STUCK and fault.kind not in self._stuck:
            self._stuck[fault.kind] = now + fault.for_s if fault.for_s else float("inf")
        elif fault.kind in self._to_miss:
            self._to_miss[fault.kind][fault.motor - 1] += round(fault.size)

    def _break_off(self, fault: FaultSettings, move: StepMove) -> NoReturn:
        """End a motion as its fault has it: whole, half, or not begun; then raise."""
        if fault.kind == "arm_timeout":
            self._arm.step(self._sent(move))
        elif fault.kind == "arm_stopped_by_pendant":
            a, b, c, d, e, f = (int(s / 2) for s in move.steps)
            self._arm.step(replace(move, steps=(a, b, c, d, e, f)))
        self._in_doubt = self._in_doubt or fault.kind != "arm_refused"
        self._fail(fault)

    def _fail(self, fault: FaultSettings) -> NoReturn:
        """Raise what a driver would; a line that is lost stays so until it is opened."""
        if fault.kind == "arm_lost":
            self._arm.close()
        elif fault.kind == "arm_timeout":
            self._script.clock.sleep(fault.size)
        raise DeviceError(Cause(fault.kind), *TEXTS[fault.kind])

    def _sent(self, move: StepMove) -> StepMove:
        """Return a command without what its motors miss of it."""
        told = _missed(move.steps, self._to_miss["following_error"])
        lost = _missed(_less(move.steps, told), self._to_miss["lost_steps"])
        self._hidden = [h + n for h, n in zip(self._hidden, lost, strict=True)]
        return _shortened(move, _less(_less(move.steps, told), lost))

    def _told(self, reading: ArmReading, struck: Iterable[FaultSettings]) -> ArmReading:
        """Return a reading as the faults let it be seen."""
        a, b, c, d, e, f = (r + h for r, h in zip(reading.registers, self._hidden, strict=True))
        now = self._script.clock.monotonic()
        contact = reading.contact
        for kind, until in self._stuck.items():
            contact = kind == "stuck_closed" if now < until else contact
        early = any(fault.kind == "early_contact" for fault in struck)
        return replace(reading, registers=(a, b, c, d, e, f), contact=contact or early)


class FaultyTracedArm(FaultyArm):
    """One around an arm that remembers what passed on its line."""

    def __init__(self, arm: Arm, faults: Iterable[FaultSettings], clock: Clock) -> None:
        super().__init__(arm, faults, clock)
        assert isinstance(arm, Traced)
        self._traced = arm

    @property
    def last_bytes(self) -> tuple[str, ...]:
        """The last chunks on the line as text, oldest first."""
        return self._traced.last_bytes


class FaultyWitnessArm(FaultyArm):
    """One around an arm whose simulated world can tell what truly happened."""

    def __init__(self, arm: Arm, faults: Iterable[FaultSettings], clock: Clock) -> None:
        super().__init__(arm, faults, clock)
        assert isinstance(arm, Witness)
        self._witness = arm

    def testimony(self) -> dict[str, object]:
        """Return the world's truth."""
        return self._witness.testimony()


def faulty_arm(arm: Arm, faults: Iterable[FaultSettings], clock: Clock) -> FaultyArm:
    """Return an arm around another that has all of its members."""
    if isinstance(arm, Traced):
        return FaultyTracedArm(arm, faults, clock)
    if isinstance(arm, Witness):
        return FaultyWitnessArm(arm, faults, clock)
    return FaultyArm(arm, faults, clock)


def _shortened(move: StepMove, steps: Steps) -> StepMove:
    """Return a command of fewer steps that lasts as long: other motors turn no faster for it."""
    longest, left = max(map(abs, move.steps)), max(map(abs, steps))
    if left in (0, longest):
        return replace(move, steps=steps)
    slowness = ceil((SPEED_ZERO - move.speed) * longest / left)
    return StepMove(steps, max(SPEED_ZERO - slowness, SPEEDS[0]))


def _missed(steps: Steps, to_miss: list[int]) -> Steps:
    """Return what motors miss of a command, taken from what they still have to."""
    found = [min(abs(s), m) * (1 if s > 0 else -1) for s, m in zip(steps, to_miss, strict=True)]
    to_miss[:] = [m - abs(n) for m, n in zip(to_miss, found, strict=True)]
    a, b, c, d, e, f = found
    return a, b, c, d, e, f


def _less(steps: Steps, missed: Steps) -> Steps:
    a, b, c, d, e, f = (s - m for s, m in zip(steps, missed, strict=True))
    return a, b, c, d, e, f
