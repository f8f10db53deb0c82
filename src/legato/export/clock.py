"""When what was recorded happened, on one time line: ns since 1970.

The cell's clock counts; the wall's time of the first event says where it begins. So a simulated
session plays at the pace of the cell and not at that of the computer.
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from legato.records.record import SessionRecord

NANO = 1_000_000_000


@dataclass(frozen=True)
class TimeLine:
    """`zero_ns` is when the cell's clock stood at `zero_s`."""

    zero_ns: int
    zero_s: float

    def at(self, seconds: float) -> int:
        """Return when the cell's clock stood at `seconds`."""
        return max(self.zero_ns + round((float(seconds) - self.zero_s) * NANO), 0)


def time_line(record: SessionRecord) -> TimeLine:
    """Return the time line of a session; without an event it begins when it was asked for."""
    if record.events:
        first = record.events[0]
        return TimeLine(nanoseconds(first.get("wall")), float(first["t"]))
    moves = record.trajectory["t"]
    return TimeLine(nanoseconds(record.meta.get("started")), float(moves[0]) if moves.size else 0.0)


def nanoseconds(wall: Any) -> int:
    """Return an ISO time as ns since 1970, 0 where it is none."""
    try:
        moment = datetime.fromisoformat(str(wall))
    except ValueError:
        return 0
    moment = moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)
    apart = moment - datetime(1970, 1, 1, tzinfo=UTC)
    return (apart.days * 86_400 + apart.seconds) * NANO + apart.microseconds * 1000


def left(record: SessionRecord, state: str) -> float:
    """Return the cell's time at which a state was left; of the first event where it never was."""
    changes = record.of_kind("state")
    for change, following in zip(changes, [*changes[1:], None], strict=True):
        if change["data"].get("state") == state:
            return float((following or record.events[-1])["t"])
    return float(record.events[0]["t"]) if record.events else time_line(record).zero_s
