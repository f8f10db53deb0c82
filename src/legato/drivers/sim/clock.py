"""The simulated cell's time: faster than the wall, or moved on by hand."""

import time
from collections.abc import Callable


class SimClock:
    """Cell seconds that run `time_scale` times faster than the wall's; 1 gives real time.

    `wall` and `sleep` are the wall clock; tests hand in others.
    """

    def __init__(
        self,
        time_scale: float = 1.0,
        *,
        wall: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        if not time_scale > 0.0:
            raise ValueError(f"time_scale is above 0, not {time_scale}")
        self._scale = time_scale
        self._wall = wall
        self._sleep = sleep
        self._began = wall()

    def monotonic(self) -> float:
        """Return cell seconds since this clock was made."""
        return (self._wall() - self._began) * self._scale

    def sleep(self, seconds: float) -> None:
        """Let `seconds` of the cell pass; none where negative."""
        if seconds > 0.0:
            self._sleep(seconds / self._scale)


class ManualClock:
    """Cell seconds that pass only when someone sleeps: tests and runs as fast as the computer."""

    def __init__(self, now: float = 0.0) -> None:
        self._now = now

    def monotonic(self) -> float:
        """Return the seconds slept so far, from the starting value on."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Move the time on at once; not at all where negative."""
        self._now += max(seconds, 0.0)
