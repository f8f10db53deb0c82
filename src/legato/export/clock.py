"""When what was recorded happened by the wall's clock: ns since 1970.

Each event tells both clocks; between two events the wall's time is found from the cell's. Before
the first and after the last the cell's clock counts, at the pace that the record says it had.
"""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from legato.geometry.transforms import Array
from legato.records.record import SessionRecord
from legato.report.clock import moment, pace

NANO = 1_000_000_000


@dataclass(frozen=True)
class TimeLine:
    """Moments that both clocks are known of: the cell's `seconds` (N,), rising, N >= 1.

    `apart_ns` (N,) is the wall's time of each since `zero_ns`; `pace` the cell's s in one of the
    wall's.
    """

    zero_ns: int
    seconds: Array
    apart_ns: Array
    pace: float = 1.0

    @property
    def zero_s(self) -> float:
        """What the cell's clock showed at `zero_ns`."""
        return float(self.seconds[0])

    def at(self, seconds: float) -> int:
        """Return the wall's time at which the cell's clock stood at `seconds`."""
        inside = float(np.clip(seconds, self.seconds[0], self.seconds[-1]))
        apart = float(np.interp(inside, self.seconds, self.apart_ns))
        apart += (float(seconds) - inside) / self.pace * NANO
        return max(self.zero_ns + round(apart), 0)


def time_line(record: SessionRecord) -> TimeLine:
    """Return the time line of a session; without an event it begins when it was asked for."""
    rows = [(float(e["t"]), nanoseconds(e.get("wall"))) for e in record.events]
    known = {seconds: when for seconds, when in reversed(rows) if when}  # of equal t the first
    if not known:
        moves = record.trajectory["t"]
        first = rows[0][0] if rows else float(moves[0]) if moves.size else 0.0
        known = {first: nanoseconds(record.meta.get("started"))}
    seconds = sorted(known)
    zero = known[seconds[0]]
    apart = np.array([known[s] - zero for s in seconds], dtype=float)
    return TimeLine(zero, np.array(seconds), apart, pace(record))


def nanoseconds(wall: Any) -> int:
    """Return an ISO time as ns since 1970, 0 where it is none."""
    found = moment(wall)
    if found is None:
        return 0
    apart = found - datetime(1970, 1, 1, tzinfo=UTC)
    return apart // timedelta(microseconds=1) * 1000


def left(record: SessionRecord, state: str) -> float:
    """Return the cell's time at which a state was left; of the first event where it never was."""
    changes = record.of_kind("state")
    for change, following in zip(changes, [*changes[1:], None], strict=True):
        if change["data"].get("state") == state:
            return float((following or record.events[-1])["t"])
    return float(record.events[0]["t"]) if record.events else time_line(record).zero_s
