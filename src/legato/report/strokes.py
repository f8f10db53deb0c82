"""Strokes as the trajectory shows them: the fingertip below a station's approach height."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from legato.geometry.transforms import Array
from legato.records.record import SessionRecord

AT_LEG = ("descend", "press", "retract")
LONGEST_MOVE_S = 0.2  # a row is written when its motion ends; no motion lasts longer


@dataclass(frozen=True)
class Stroke:
    """The time at a station in the cell's seconds, and the trajectory's rows [first, last]."""

    station: float
    number: int
    began: float
    ended: float
    first: int
    last: int

    def holds(self, moment: float) -> bool:
        """Say whether a moment of the cell's clock falls into the stroke."""
        return self.began <= moment <= self.ended


def strokes_of(record: SessionRecord) -> list[Stroke]:
    """Return every stroke in order, those broken off too; numbered as the cell told them.

    A stroke that was broken off and made again is there twice, under one number.
    """
    path = record.trajectory
    found: list[Stroke] = []
    counts: dict[float, int] = {}
    changes = [float(e["t"]) for e in record.of_kind("state")]
    told = [e for e in record.of_kind("progress") if e["data"].get("stroke") is not None]
    for row, begins in _rows_at_leg(path["why"], path["station_mm"]):
        station, t = float(path["station_mm"][row]), float(path["t"][row])
        if begins or not found:
            number = _told(told, station, t) or counts.get(station, 0) + 1
            counts[station] = number
            before = float(path["t"][row - 1]) if row else t - LONGEST_MOVE_S
            entered = max((at for at in changes if at <= t), default=before)  # a pause is left out
            found.append(Stroke(station, number, max(before, entered), t, row, row))
        else:
            found[-1] = replace(found[-1], ended=t, last=row)
    return found


def _told(progress: Sequence[Mapping[str, Any]], station: float, t: float) -> int | None:
    """Return the number of the stroke that the cell told last at a station, None without one."""
    own = [e["data"] for e in progress if float(e["t"]) <= t]
    return int(own[-1]["stroke"]) if own and own[-1].get("station_mm") == station else None


def began(record: SessionRecord) -> float | None:
    """Return the cell's time at which the session's first motion began at the earliest."""
    times = record.trajectory["t"]
    return float(times[0]) - LONGEST_MOVE_S if times.size else None


def _rows_at_leg(whys: Array, stations: Array) -> Iterator[tuple[int, bool]]:
    """Yield the rows of motions at the leg, and whether each begins a stroke.

    Rows that are no motion (readings, dwells) neither begin nor end one.
    """
    last, place = "", np.nan
    for row, (why, station) in enumerate(zip(whys, stations, strict=True)):
        if not why:
            continue
        at_leg = why in AT_LEG and bool(np.isfinite(station))
        if at_leg:
            again = why == "descend" and last != "descend"
            yield row, again or last not in AT_LEG or station != place
        last, place = str(why), station
