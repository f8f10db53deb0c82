"""The cell's clocks: scaled, and moved on by hand."""

import pytest

from legato.drivers.sim.clock import ManualClock, SimClock
from legato.hal.clock import Clock


class Wall:
    """A wall clock that passes when slept on, and remembers each sleep."""

    def __init__(self) -> None:
        self.now = 100.0
        self.slept: list[float] = []

    def sleep(self, seconds: float) -> None:
        """Pass at once."""
        self.slept.append(seconds)
        self.now += seconds


def test_cell_seconds_run_faster_than_the_walls() -> None:
    """At time_scale 20 a second of the cell costs the wall a twentieth."""
    wall = Wall()
    clock: Clock = SimClock(20.0, wall=lambda: wall.now, sleep=wall.sleep)
    assert clock.monotonic() == 0.0
    clock.sleep(3.0)
    assert wall.slept == [pytest.approx(0.15)]
    assert clock.monotonic() == pytest.approx(3.0)


def test_no_time_is_slept_where_none_is_left() -> None:
    """Zero and negative waits do not call the wall's sleep."""
    wall = Wall()
    clock = SimClock(1.0, wall=lambda: wall.now, sleep=wall.sleep)
    clock.sleep(0.0)
    clock.sleep(-1.0)
    assert wall.slept == []


def test_time_cannot_stand_still() -> None:
    """A scale that is not above 0 is refused."""
    with pytest.raises(ValueError, match="time_scale"):
        SimClock(0.0)


def test_a_manual_clock_passes_only_by_sleep() -> None:
    """Reading it changes nothing; sleep moves it on, never back."""
    clock: Clock = ManualClock(5.0)
    clock.sleep(2.5)
    clock.sleep(-9.0)
    assert clock.monotonic() == clock.monotonic() == 7.5
