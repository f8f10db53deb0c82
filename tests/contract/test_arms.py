"""What every arm driver promises, held by the simulated arm and by the TeachMover's alike.

The TeachMover's driver talks through a real pseudo-terminal to an emulated controller over the
same simulated world. Each is held to it alone, and within an arm that could go wrong.
"""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.drivers.sim.clock import SimClock
from legato.drivers.teachmover import TeachMover, TeachMoverSettings
from legato.geometry.motion import (
    StepMove,
    ToolPose,
)
from legato.geometry.transforms import apply
from legato.hal.arm import Arm, ArmReading, Traced, Witness
from legato.hal.faults import Cause
from tests.contract.arms import BENCHES, HOME, LEG, ZERO, Bench, cause_of, go, over_a_line


@pytest.fixture(params=BENCHES)
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """Each driver in turn, not opened yet."""
    with BENCHES[request.param]() as made:
        yield made


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
