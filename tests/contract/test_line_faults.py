"""What goes wrong on a real line ends in its cause, in time, with its bytes."""

from pathlib import Path

import pytest

from legato.drivers.sim.clock import SimClock
from legato.geometry.motion import (
    ToolPose,
)
from legato.geometry.transforms import apply
from legato.hal.arm import Traced
from legato.hal.faults import Cause
from tests.contract.arms import HOME, LEG, MOVE, answered, cause_of, go, over_a_line


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
