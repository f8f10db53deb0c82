"""The worker's pulse: promises are kept in time, or the worker counts as stuck."""

from math import inf

import pytest

from legato.control.effects import Dwell, Enter, Grab, Hold, Move, ReadArm, Solve, Why
from legato.control.states import DEADLINES
from legato.daemon.pulse import Allowed, Pulse
from legato.geometry.motion import StepMove

MOVE = Move(StepMove((0,) * 6, 0), (0,) * 6, (0,) * 6, Why.TRANSIT)


def test_a_promise_that_is_not_kept_names_what_is_stuck() -> None:
    """Until its time is up all is well, and the next promise makes it well again."""
    now = [100.0]
    pulse = Pulse(now=lambda: now[0])
    pulse.promise("Move", 2.0)
    now[0] = 102.0
    assert pulse.overdue() is None
    now[0] = 102.1
    assert pulse.overdue() == "Move"
    pulse.promise("waiting", 10.0)
    assert pulse.overdue() is None


def test_a_worker_that_never_began_is_stuck_in_the_end() -> None:
    """Opening the devices has its time too."""
    now = [0.0]
    pulse = Pulse(now=lambda: now[0])
    assert pulse.overdue() is None
    now[0] = 3600.0
    assert pulse.overdue() == "start"


def test_a_drivers_call_may_last_as_long_as_its_own_time_out() -> None:
    """Short for the arm, the state's deadline for camera and solver, for ever for a hold."""
    allowed = Allowed(arm_s=1.0, camera_s=3.0)
    assert 3.0 < allowed.seconds(MOVE) == allowed.seconds(ReadArm()) < 10.0
    assert allowed.seconds(Grab("capture")) > DEADLINES["capture"] + 3.0
    assert allowed.seconds(Solve(None)) > DEADLINES["calibrate"]  # type: ignore[arg-type]
    assert allowed.seconds(Hold()) == inf
    assert allowed.seconds(Enter("idle")) < 30.0


@pytest.mark.parametrize("slowness", [1.0, 10.0])
def test_a_slow_world_has_more_time(slowness: float) -> None:
    """A simulated cell in slow motion dwells as much longer."""
    allowed = Allowed(slowness=slowness)
    assert allowed.seconds(Dwell(60.0)) > 60.0 * slowness
