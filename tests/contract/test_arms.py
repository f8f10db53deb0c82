"""What every arm driver promises, held by the simulated arm and by the TeachMover's alike.

The TeachMover's driver talks through a real pseudo-terminal to an emulated controller over the
same simulated world. Each is held to it alone, and within an arm that could go wrong.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.drivers.emulator import Emulator, Faults, PseudoTerminal, fault
from legato.drivers.faulty.arm import faulty_arm
from legato.drivers.sim.arm import SimArm
from legato.drivers.sim.clock import ManualClock, SimClock
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import World
from legato.drivers.teachmover import TeachMover, TeachMoverSettings
from legato.geometry.arm import ArmModel
from legato.geometry.leg import Leg
from legato.geometry.motion import (
    StepMove,
    Steps,
    ToolPose,
    move_between,
    pose_steps,
    rounded,
    straight_path,
)
from legato.geometry.transforms import apply
from legato.hal.arm import Arm, ArmReading, Traced, Witness
from legato.hal.clock import Clock
from legato.hal.faults import Cause, DeviceError

MODEL, LEG = ArmModel(), Leg()
HOME = ToolPose(127.0, 0.0, 150.0)
ZERO: Steps = (0, 0, 0, 0, 0, 0)


@dataclass
class Bench:
    """An arm under test, the true world behind it, and what can be done to its line.

    `plugged` can be acquired once each time that the line was plugged in.
    """

    arm: Arm
    world: World
    cut: Callable[[], None] | None = None
    port: str = ""
    plugged: threading.Semaphore = field(default_factory=lambda: threading.Semaphore(0))


def still_world(clock: Clock | None = None) -> World:
    """Return a world whose leg lies where the settings say, and whose clock never waits."""
    true = SimSettings(scatter_mm=0.0, scatter_deg=0.0, backlash_steps=0.0)
    return World(true, LEG, MODEL, clock if clock is not None else ManualClock())


@contextmanager
def simulated() -> Iterator[Bench]:
    """Make the simulated arm in this process."""
    world = still_world()
    yield Bench(SimArm(world), world)


@contextmanager
def wrapped() -> Iterator[Bench]:
    """Wrap the simulated arm in one that could go wrong, and does not."""
    world = still_world()
    yield Bench(faulty_arm(SimArm(world), (), world.clock), world)


@contextmanager
def wrapped_over_a_line() -> Iterator[Bench]:
    """Wrap the TeachMover's driver in the same way."""
    with over_a_line() as made:
        made.arm = faulty_arm(made.arm, (), SimClock())
        yield made


@contextmanager
def over_a_line(
    *faults: str, clock: Clock | None = None, margin_s: float = 3.0, link: Path | None = None
) -> Iterator[Bench]:
    """Put the TeachMover's driver on a pseudo-terminal, by a link to it if one is named."""
    world = still_world(clock)
    far = SimArm(world)
    far.open()
    emulator = Emulator(far, world.clock, faults=Faults(map(fault, faults)))
    plugged = threading.Semaphore(0)

    def opened(path: str) -> None:
        if link is not None:
            link.unlink(missing_ok=True)
            link.symlink_to(path)
        plugged.release()

    with PseudoTerminal(emulator, opened) as line:
        thread = threading.Thread(target=line.serve, name="emulator")
        thread.start()
        port = line.path if link is None else str(link)
        arm = TeachMover(TeachMoverSettings(port=port, reply_margin_s=margin_s), SimClock())

        def cut() -> None:
            line.stop()
            thread.join()
            line.close()

        try:
            yield Bench(arm, world, cut, port, plugged)
        finally:
            arm.close()
            if thread.is_alive():
                cut()


BENCHES = {
    "sim": simulated,
    "teachmover": over_a_line,
    "faulty sim": wrapped,
    "faulty teachmover": wrapped_over_a_line,
}


@pytest.fixture(params=BENCHES)
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """Each driver in turn, not opened yet."""
    with BENCHES[request.param]() as made:
        yield made


def cause_of(call: Callable[[], object]) -> Cause:
    """Return the cause that a call raises."""
    with pytest.raises(DeviceError) as caught:
        call()
    return caught.value.cause


def whole(pose: ToolPose) -> Steps:
    """Return a pose's rounded half-steps."""
    return next(iter(rounded(pose_steps(MODEL, pose.vector())[None])))


def go(arm: Arm, start: ToolPose, end: ToolPose) -> ArmReading:
    """Move the fingertip along a straight line and return the last reading."""
    at, reading = whole(start), arm.read()
    for target in rounded(straight_path(MODEL, start, end)):
        reading = arm.step(move_between(MODEL, at, target))
        at = target
    return reading


def test_it_is_an_arm_that_says_whether_it_is_real(bench: Bench) -> None:
    """It has every member of the protocol; only the simulation is a witness."""
    assert isinstance(bench.arm, Arm)
    assert bench.arm.simulated is isinstance(bench.arm, Witness)
    assert bench.arm.simulated is not isinstance(bench.arm, Traced)
    assert not bench.arm.position_in_doubt


def test_nothing_works_before_open_and_after_close(bench: Bench) -> None:
    """Each call on an arm that is not open is arm_lost, and moves nothing."""
    move = StepMove((5, 0, 0, 0, 0, 0), 100)
    calls: list[Callable[[], object]] = [
        bench.arm.read, bench.arm.zero, lambda: bench.arm.step(move),
    ]  # fmt: skip
    assert [cause_of(c) for c in calls] == [Cause.ARM_LOST] * 3
    bench.arm.open()
    bench.arm.close()
    assert [cause_of(c) for c in calls] == [Cause.ARM_LOST] * 3
    assert bench.world.registers == ZERO


def test_open_and_close_are_idempotent_and_move_nothing(bench: Bench) -> None:
    """Twice is as good as once, and the registers outlive a closed line."""
    bench.arm.open()
    bench.arm.open()
    assert bench.arm.read() == ArmReading(ZERO, False, 0)
    bench.arm.step(StepMove((5, 0, 0, 0, 0, 0), 100))
    bench.arm.close()
    bench.arm.close()
    bench.arm.open()
    assert bench.arm.read().registers == (5, 0, 0, 0, 0, 0)


def test_a_step_returns_the_reading_after_the_motion(bench: Bench) -> None:
    """Registers have moved by exactly the command, and a read says the same."""
    bench.arm.open()
    reading = bench.arm.step(StepMove((3, -20, 40, 7, -7, 40), 150))
    assert reading.registers == (3, -20, 40, 7, -7, 40)
    assert bench.arm.read() == reading


def test_a_step_of_nothing_is_harmless(bench: Bench) -> None:
    """Zero steps change nothing."""
    bench.arm.open()
    assert bench.arm.step(StepMove(ZERO, 0)).registers == ZERO


@pytest.mark.parametrize("driver", BENCHES)
@settings(max_examples=10, deadline=None)
@given(
    moves=st.lists(
        st.builds(
            StepMove,
            st.tuples(*[st.integers(-60, 60)] * 6),
            st.integers(0, 190),
        ),
        max_size=6,
    )
)
def test_registers_are_the_sum_of_commands(driver: str, moves: list[StepMove]) -> None:
    """No step is lost or doubled on the way, whatever the commands."""
    with BENCHES[driver]() as made:
        made.arm.open()
        total = np.zeros(6, int)
        for move in moves:
            total += np.array(move.steps)
            assert made.arm.step(move).registers == tuple(total)


def test_zero_zeroes_where_the_arm_stands(bench: Bench) -> None:
    """The registers start again; the arm does not move."""
    bench.arm.open()
    bench.arm.step(StepMove((30, 0, 0, 0, 0, 0), 100))
    before = bench.world.testimony()["tip"]
    bench.arm.zero()
    assert bench.arm.read().registers == ZERO
    assert bench.world.testimony()["tip"] == before
    assert bench.arm.step(StepMove((-30, 0, 0, 0, 0, 0), 100)).registers[0] == -30


def test_the_switch_closes_on_the_leg_and_opens_off_it(bench: Bench) -> None:
    """Pressing on the leg is contact in the very reading of that step, lifting ends it."""
    bench.arm.open()
    place = apply(bench.world.world_from_object, LEG.surface_point([67.0]))[0]
    above = ToolPose(place[0], place[1], place[2] + 5.0)
    down = ToolPose(place[0], place[1], place[2] - 1.5)
    assert not go(bench.arm, HOME, above).contact
    assert go(bench.arm, above, down).contact
    assert bench.arm.read().contact
    assert not go(bench.arm, down, above).contact
    assert bench.world.testimony()["breaches"] == []


def test_a_cut_line_is_lost_and_close_is_quiet(bench: Bench) -> None:
    """Where there is a line, hanging it up is arm_lost for every later call."""
    bench.arm.open()
    if bench.cut is None:
        bench.arm.close()
    else:
        bench.cut()
    assert cause_of(bench.arm.read) is Cause.ARM_LOST
    assert cause_of(bench.arm.read) is Cause.ARM_LOST
    bench.arm.close()


def test_one_arm_a_port() -> None:
    """A second driver on the same line is refused, and the first goes on."""
    with over_a_line() as made:
        made.arm.open()
        second = TeachMover(TeachMoverSettings(port=made.port), SimClock())
        assert cause_of(second.open) is Cause.ARM_LOST
        assert made.arm.read().registers == ZERO


def answered(arm: Arm) -> ArmReading:
    """Return a reading, asked for until the line has recovered."""
    for _ in range(10):
        try:
            return arm.read()
        except DeviceError:
            continue
    raise AssertionError("the line never recovered")


MOVE = StepMove((40, 0, 0, 0, 0, 0), 200)


@pytest.mark.parametrize(
    ("spelled", "cause", "doubt"),
    [
        ("silence", Cause.ARM_TIMEOUT, True),
        ("late:by=0.6", Cause.ARM_TIMEOUT, True),
        ("garbage", Cause.ARM_LOST, True),
        ("0", Cause.ARM_REFUSED, False),
        ("2", Cause.ARM_STOPPED_BY_PENDANT, True),
        ("silence:on=read,after=1", Cause.ARM_TIMEOUT, False),
        ("garbage:on=read,after=1", Cause.ARM_LOST, False),
        ("0:on=read,after=1", Cause.ARM_REFUSED, False),
    ],
)
def test_a_fault_has_its_cause_in_time_and_its_bytes(
    spelled: str, cause: Cause, doubt: bool
) -> None:
    """The motion that it strikes ends in its cause, soon after the motion and the margin.

    The last bytes tell of it. Then the line is of use again: its registers are the arm's own, not
    those of a late reply, and a doubt about the position lasts until they are zeroed.
    """
    clock = SimClock()
    with over_a_line(spelled, clock=clock, margin_s=0.4) as made:
        made.arm.open()
        began = clock.monotonic()
        assert cause_of(lambda: made.arm.step(MOVE)) is cause
        # The margin, the line's time and one look; the rest is for a busy computer.
        assert clock.monotonic() - began < MOVE.duration + 0.4 + 0.2 + 3.0
        assert isinstance(made.arm, Traced)
        assert any("@STEP 200,40" in chunk for chunk in made.arm.last_bytes)
        assert made.arm.position_in_doubt is doubt
        assert answered(made.arm).registers == made.world.registers
        assert answered(made.arm).registers == made.world.registers
        assert made.arm.position_in_doubt is doubt
        made.arm.zero()
        assert not made.arm.position_in_doubt
        assert made.arm.step(MOVE).registers == MOVE.steps


def test_an_adapter_that_comes_back_is_opened_again(tmp_path: Path) -> None:
    """A hang-up is arm_lost with doubt; opening the same name again reaches the same registers."""
    with over_a_line("hang-up:by=0.05", link=tmp_path / "arm") as made:
        made.arm.open()
        assert made.plugged.acquire(timeout=10.0)
        assert cause_of(lambda: made.arm.step(MOVE)) is Cause.ARM_LOST
        assert made.arm.position_in_doubt
        assert cause_of(made.arm.read) is Cause.ARM_LOST
        assert made.plugged.acquire(timeout=10.0)
        made.arm.open()
        assert made.arm.read().registers == made.world.registers == MOVE.steps
        assert made.arm.position_in_doubt


def test_an_adapter_that_stays_away_is_lost() -> None:
    """Opening a port that is gone is arm_lost each time, and closing it is quiet."""
    with over_a_line("hang-up") as made:
        made.arm.open()
        assert cause_of(lambda: made.arm.step(MOVE)) is Cause.ARM_LOST
        assert [cause_of(made.arm.open) for _ in range(2)] == [Cause.ARM_LOST] * 2
        made.arm.close()


def test_lost_steps_do_not_show_in_the_registers() -> None:
    """Without encoders the registers count what was sent: only the true world knows."""
    with over_a_line("lost-steps:motor=1,by=25") as made:
        made.arm.open()
        assert made.arm.step(MOVE).registers == MOVE.steps
        assert made.world.testimony()["lost_steps"] == [25, 0, 0, 0, 0, 0]
        assert not made.arm.position_in_doubt


@pytest.mark.parametrize(("spelled", "contact"), [("stuck-open", False), ("stuck-closed", True)])
def test_a_stuck_switch_reads_the_same_on_and_off_the_leg(spelled: str, contact: bool) -> None:
    """The driver cannot tell: whoever presses must know where contact has to come."""
    with over_a_line(spelled) as made:
        made.arm.open()
        place = apply(made.world.world_from_object, LEG.surface_point([67.0]))[0]
        above = ToolPose(place[0], place[1], place[2] + 5.0)
        down = ToolPose(place[0], place[1], place[2] - 1.5)
        assert go(made.arm, HOME, above).contact is contact
        assert go(made.arm, above, down).contact is contact
        assert made.world.switch_closed
