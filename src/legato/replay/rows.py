"""trajectory.csv beside a replay: each motion's half-steps, and what was read back after it."""

from typing import Any

from legato.control.effects import Move
from legato.geometry.motion import Steps
from legato.hal.arm import ArmReading
from legato.records.record import SessionRecord
from legato.records.trajectory import COMMANDED, READ
from legato.replay.differs import Differs, hold


class Rows:
    """Takes a record's rows one after another."""

    def __init__(self, record: SessionRecord) -> None:
        self._columns = record.trajectory
        self._count = len(self._columns["t"])
        self._at = 0
        self._broken_off = record.meta.get("outcome") in (None, "interrupted")

    def left(self) -> str | None:
        """Return the next row that was not taken, None where there is none."""
        return f"trajectory row {self._at + 1}" if self._at < self._count else None

    def read(self, where: str, reading: ArmReading, reference: Steps) -> None:
        """Hold the row of where the arm stood before its first motion, if it is that one."""
        if self._at == 0 and self._count and not self._columns["why"][0]:
            stood = [a + b for a, b in zip(reference, reading.registers, strict=True)]
            self._hold(where, stood, stood, reading.contact, "")

    def move(self, where: str, move: Move, reading: ArmReading, reference: Steps) -> None:
        """Hold the row of a motion."""
        read = [a + b for a, b in zip(reference, reading.registers, strict=True)]
        self._hold(where, list(move.target), read, reading.contact, str(move.why))

    def skip(self, where: str, move: Move) -> None:
        """Hold only what was commanded: the arm's answer is in the fault."""
        if self._at < self._count:
            row, number = self._row(), self._at
            hold(f"{where}, trajectory row {number}, commanded", row["commanded"], move.target)

    def _hold(
        self, where: str, commanded: list[int], read: list[int], contact: bool, why: str
    ) -> None:
        if self._at >= self._count:
            if self._broken_off:
                return
            raise Differs(f"{where}, trajectory row {self._at + 1}", None, commanded)
        recorded = self._row()
        replayed = {"commanded": commanded, "read": read, "contact": contact, "why": why}
        hold(f"{where}, trajectory row {self._at}", recorded, replayed)

    def _row(self) -> dict[str, Any]:
        at, columns = self._at, self._columns
        self._at += 1
        return {
            "commanded": [int(columns[name][at]) for name in COMMANDED],
            "read": [int(columns[name][at]) for name in READ],
            "contact": bool(columns["contact"][at]),
            "why": str(columns["why"][at]),
        }
