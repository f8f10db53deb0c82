"""Times of day from ages that the daemon tells in the cell's seconds.

A person reads the wall's clock; a simulated cell's seconds pass `time_scale` times as fast.
"""

from datetime import datetime, timedelta

JITTER = timedelta(seconds=1.5)  # an answer's way and the clocks' grain: still the same moment


class When:
    """The moments that were told, each by a name; one that is told again stands still."""

    def __init__(self, time_scale: float) -> None:
        self._scale = time_scale
        self._moments: dict[str, datetime] = {}

    def told(self, name: str, age_s: float | None, wall: str) -> str | None:
        """Return the ISO time at which something was `age_s` old at `wall`; None where unknown."""
        if age_s is None:
            self._moments.pop(name, None)
            return None
        then = datetime.fromisoformat(wall) - timedelta(seconds=age_s / self._scale)
        before = self._moments.get(name)
        if before is None or abs(then - before) > JITTER:
            self._moments[name] = then
        return self._moments[name].isoformat()
