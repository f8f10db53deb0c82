"""Latencies counted by size; one thread adds, any may read."""

from bisect import bisect_left
from collections.abc import Mapping
from typing import Any, Final

BOUNDS_MS: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)


class Tally:
    """A histogram over BOUNDS_MS, the last bucket for all that took longer."""

    def __init__(self) -> None:
        self._counts = [0] * (len(BOUNDS_MS) + 1)
        self._longest_ms = self._sum_ms = 0.0
        self._told = self._tell()

    def add(self, seconds: float) -> None:
        """Count one latency."""
        ms = seconds * 1000.0
        self._counts[bisect_left(BOUNDS_MS, ms)] += 1
        self._longest_ms = max(self._longest_ms, ms)
        self._sum_ms += ms
        self._told = self._tell()

    def told(self) -> Mapping[str, Any]:
        """Return how many took at most each bound, more than that, and how long the longest."""
        return self._told

    def _tell(self) -> Mapping[str, Any]:
        counts = list(self._counts)
        return {
            "count": sum(counts),
            "max_ms": round(self._longest_ms, 3) if any(counts) else None,
            "at_most_ms": list(BOUNDS_MS),
            "counts": counts,
            "sum_ms": round(self._sum_ms, 3),
        }
