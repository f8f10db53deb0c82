"""What the daemon counts about itself, whoever asks for it. Each member has one writing thread."""

import time
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from legato.daemon.desk import Desk
from legato.daemon.who import LOCAL, Who

LATENCIES_S: Final = (0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.5, 1.0)
EFFECTS_S: Final = (0.001, 0.01, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 180.0)
HEIGHTS_MM: Final = (-2.0, -1.5, -1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0)


class Histogram:
    """Counts by size, and their sum; one thread adds, any may read."""

    def __init__(self, bounds: Sequence[float]) -> None:
        self.bounds = tuple(bounds)
        self.counts = [0] * (len(bounds) + 1)
        self.sum = 0.0

    def add(self, value: float) -> None:
        """Count one value."""
        self.counts[bisect_left(self.bounds, value)] += 1
        self.sum += value


class Counts:
    """All that is counted. Each member has one thread that writes it."""

    def __init__(self, stations: Iterable[float] = ()) -> None:
        self.sessions: dict[tuple[str, str], int] = defaultdict(int)
        self.faults: dict[str, int] = defaultdict(int)
        self.entered: dict[str, int] = defaultdict(int)
        self.requests = Histogram(LATENCIES_S)
        self.late = Histogram(LATENCIES_S)
        self.effects: dict[str, Histogram] = defaultdict(lambda: Histogram(EFFECTS_S))
        self.heights: dict[str, Histogram] = defaultdict(lambda: Histogram(HEIGHTS_MM))
        for station in stations:
            self.heights[f"{station:g}"] = Histogram(HEIGHTS_MM)

    def heard(self, topic: str, data: Mapping[str, Any]) -> None:
        """Count what an event tells; the loop's thread calls this for each that is published."""
        match topic:
            case "state":
                self.entered[str(data["state"])] += 1
            case "fault":
                self.faults[str(data["cause"])] += 1
            case "session":
                if data.get("outcome") is not None:
                    self.sessions[str(data["job"]), str(data["outcome"])] += 1
            case "contact":
                self.heights[f"{data['station_mm']:g}"].add(float(data["contact_mm"]))

    def timed(self, effect: str, seconds: float) -> None:
        """Count how long an effect took; the worker's thread calls this."""
        self.effects[effect].add(seconds)


class CountedDesk(Desk):
    """A desk that counts how long each message keeps the loop."""

    counts = Counts()

    def receive(
        self, frames: Sequence[bytes], now: float, who: Who = LOCAL, since: int | None = None
    ) -> None:
        """Take in one message, and count the time until the next may be."""
        began = time.perf_counter()
        super().receive(frames, now, who, since)
        self.counts.requests.add(time.perf_counter() - began)
