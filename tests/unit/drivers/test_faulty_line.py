"""Driver and emulator joined in memory, in exact time, with anything going wrong in any order.

Two clocks: the host's, and the robot's, whose bytes reach the host when their time has come.
"""

from collections import deque
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.drivers.emulator import Emulator, Fault, Faults, Kind, fault
from legato.drivers.sim.arm import SimArm
from legato.drivers.sim.clock import ManualClock
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import World
from legato.drivers.teachmover import POLL_S, TeachMover, TeachMoverSettings
from legato.geometry.arm import ArmModel
from legato.geometry.leg import Leg
from legato.geometry.motion import StepMove
from legato.hal.faults import Cause, DeviceError

MARGIN_S = 0.5
LINE_S = 120 * 10 / 9600  # a command, and the longest line that may come back


class Line:
    """A port whose far end is an emulator that runs on a clock of its own."""

    def __init__(self, host: ManualClock, robot: ManualClock, emulator: Emulator) -> None:
        self.host = host
        self.robot = robot
        self.emulator = emulator
        self.coming: deque[tuple[float, bytes]] = deque()
        self.gone = False

    @property
    def in_waiting(self) -> int:
        """Bytes that have reached the host."""
        return sum(len(data) for when, data in self.coming if when <= self.host.monotonic())

    def read(self, size: int = 1) -> bytes:
        """Return what is there, or wait for the next byte, but no longer than a look lasts."""
        if self.gone:
            raise OSError(5, "gone")
        if not self.in_waiting:
            left = self.coming[0][0] - self.host.monotonic() if self.coming else POLL_S
            self.host.sleep(min(left, POLL_S))
        data = b""
        while self.coming and self.coming[0][0] <= self.host.monotonic() and len(data) < size:
            data += self.coming.popleft()[1]
        return data

    def write(self, data: bytes) -> int:
        """Let the robot do what it is told, in its own time."""
        if self.gone:
            raise OSError(5, "gone")
        self.robot.sleep(self.host.monotonic() - self.robot.monotonic())
        for out in self.emulator.talk(data):
            if isinstance(out, bytes):
                self.coming.append((self.robot.monotonic(), out))
            else:
                self.gone = True
        return len(data)

    def reset_input_buffer(self) -> None:
        """Throw away what has come in."""
        if self.gone:
            raise OSError(5, "gone")
        while self.coming and self.coming[0][0] <= self.host.monotonic():
            self.coming.popleft()

    def close(self) -> None:
        """Let go; what was on the way is lost."""
        self.coming.clear()


class Cell:
    """A driver on a faulty line, the true world behind it, and adapters as many as wanted."""

    def __init__(self, *faults: Fault, seed: int = 0) -> None:
        self.host, self.robot = ManualClock(), ManualClock()
        still = SimSettings(scatter_mm=0.0, scatter_deg=0.0)
        self.world = World(still, Leg(), ArmModel(), self.robot)
        arm = SimArm(self.world)
        arm.open()
        self.emulator = Emulator(arm, self.robot, baud=9600, faults=Faults(faults, seed))
        settings = TeachMoverSettings(port="/dev/arm", reply_margin_s=MARGIN_S)
        self.driver = TeachMover(settings, self.host, lambda _: self.plugged_in())

    def plugged_in(self) -> Line:
        """Return a new line to the same robot."""
        return Line(self.host, self.robot, self.emulator)

    def recover(self) -> None:
        """Open and read until the arm answers, as someone does who resets again and again."""
        for _ in range(30):
            try:
                self.driver.open()
                reading = self.driver.read()
            except DeviceError:
                continue
            assert reading.registers == self.world.registers
            return
        raise AssertionError("the line never recovered")


steps = st.integers(-60, 60)
moves = st.builds(StepMove, st.tuples(*[steps] * 6), st.integers(100, 200))
counts = st.integers(0, 12)
ordinary = [Kind.SILENCE, Kind.GARBAGE, Kind.REFUSED, Kind.PENDANT, Kind.HANG_UP]
faults = st.builds(
    Fault, st.sampled_from(ordinary), after=counts, on=st.sampled_from(["step", "read", "any"])
)
late = st.builds(
    Fault,
    st.just(Kind.LATE),
    after=counts,
    on=st.sampled_from(["step", "read"]),
    by=st.floats(0.0, 10.0),
)


@settings(max_examples=120, deadline=None)
@given(
    st.lists(st.tuples(moves, st.booleans()), min_size=1, max_size=10),
    st.lists(faults, max_size=4),
    st.lists(late, max_size=2),
)
def test_a_reading_is_always_the_arms_own(
    sent: list[tuple[StepMove, bool]], wrong: list[Fault], slow: list[Fault]
) -> None:
    """Whatever goes wrong, each call ends in time with a typed error or with the truth.

    A step that returns has moved by exactly its command. No late or lost reply ever stands for
    another's, whether the line is left to recover after an error or used on at once.
    """
    cell = Cell(*wrong, *slow)
    cell.recover()
    for move, patient in sent:
        before, began = cell.world.registers, cell.host.monotonic()
        try:
            cell.driver.open()
            reading = cell.driver.step(move)
        except DeviceError:
            spent = cell.host.monotonic() - began
            # At most: settling by two reads and waiting for quiet, then the step and its read.
            assert spent <= move.duration + 6 * (MARGIN_S + LINE_S + POLL_S)
            if patient:
                cell.recover()
            continue
        moved = tuple(b + s for b, s in zip(before, move.steps, strict=True))
        assert reading.registers == cell.world.registers == moved
    cell.recover()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.05, 0.3))
def test_a_line_that_fails_all_the_time_gives_no_wrong_reading(seed: int, chance: float) -> None:
    """With faults by chance on any command a reading is still the truth, and doubt is kept."""
    wrong = [Fault(kind, p=chance, on="any") for kind in (Kind.SILENCE, Kind.GARBAGE, Kind.PENDANT)]
    cell = Cell(*wrong, seed=seed)
    doubted = False
    for _ in range(40):
        try:
            cell.driver.open()
            reading = cell.driver.step(StepMove((1, 2, -3, 4, -5, 6), 200))
        except DeviceError:
            assert cell.driver.position_in_doubt or not doubted
            doubted = doubted or cell.driver.position_in_doubt
            continue
        assert reading.registers == cell.world.registers
        assert cell.driver.position_in_doubt is doubted


@pytest.mark.parametrize(
    ("spelled", "cause"),
    [
        ("silence", Cause.ARM_TIMEOUT),
        ("late:by=3", Cause.ARM_TIMEOUT),
        ("garbage", Cause.ARM_LOST),
        ("0", Cause.ARM_REFUSED),
        ("2", Cause.ARM_STOPPED_BY_PENDANT),
        ("hang-up", Cause.ARM_LOST),
    ],
)
@pytest.mark.parametrize("on", ["step", "read"])
def test_each_fault_ends_in_its_cause_within_its_deadline(
    spelled: str, cause: Cause, on: str
) -> None:
    """The motion's own time, the line's and the margin: no more, to the length of one look."""
    cell = Cell(replace(fault(spelled), on=on, after=int(on == "read")))
    cell.recover() if on == "step" else cell.driver.open()
    move, began = StepMove((300, 0, 0, 0, 0, 0), 183), cell.host.monotonic()
    with pytest.raises(DeviceError) as caught:
        cell.driver.step(move)
    assert caught.value.cause is cause
    exchanges = 1 if on == "step" else 2
    spent = cell.host.monotonic() - began
    assert spent <= move.duration + exchanges * LINE_S + MARGIN_S + POLL_S + 0.03
    assert cell.driver.position_in_doubt is (on == "step" and spelled != "0")


def test_an_arm_that_was_switched_off_shows_in_its_registers() -> None:
    """They count from zero again: whoever compares them with what was sent finds out."""
    cell = Cell(fault("restart:after=1"))
    cell.recover()
    move = StepMove((10, 0, 0, 0, 0, 0), 183)
    assert cell.driver.step(move).registers[0] == 10
    assert cell.driver.step(move).registers[0] == 10
    assert not cell.driver.position_in_doubt


def test_an_answer_that_is_still_owed_is_waited_for() -> None:
    """Two reads answered late, one after the other: the second's answer ends no motion early."""
    cell = Cell(fault("late:on=read,after=1,by=0.6"), fault("late:on=read,after=2,by=0.4"))
    cell.driver.open()
    with pytest.raises(DeviceError):
        cell.driver.read()
    move = StepMove((20, 0, 0, 0, 0, 0), 183)
    assert cell.driver.step(move).registers[0] == 20
    assert not cell.driver.position_in_doubt
