"""What of the records still counts: a pose that the daemon no longer holds is none of the present.

A picture belongs to the daemon's process that took it; a pose, and the contacts that were made by
it, to the session that found the leg, as `status` names it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Held:
    """What the daemon holds: its boot, and the calibration of `status` if it holds one."""

    boot: str | None = None
    calibration: Row | None = None

    @property
    def session(self) -> str | None:
        """The session that found the leg."""
        return None if self.calibration is None else self.calibration.get("session")

    def if_heard(self, earlier: bool) -> bool | None:
        """Return whether something is earlier, None where no daemon has been heard yet."""
        return earlier if self.boot is not None else None

    @property
    def bands(self) -> list[Any] | None:
        """The stations' bands by control.band."""
        return None if self.calibration is None else self.calibration.get("stations")


def picture_told(view: Row | None, held: Held) -> dict[str, Any] | None:
    """Return the newest picture; `earlier` where another process of the daemon took it.

    `earlier` is None where no daemon has been heard: then nobody knows whose picture it is.
    """
    if view is None:
        return None
    return {**view, "earlier": held.if_heard(view["boot"] != held.boot)}


def leg_told(solved: Row | None, held: Held) -> dict[str, Any] | None:
    """Return the leg's present pose, None where the daemon holds none or it is not read yet."""
    if solved is None or held.session is None or solved["by"] != held.session:
        return None
    pose = solved["solved"]["world_from_object"]
    return {"session": held.session, "world_from_object": pose, "stations": held.bands}


@dataclass
class Contacts:
    """The contacts of one session; `by` is the session whose pose they were made by."""

    session: str | None = None
    by: str | None = None
    bands: list[Any] | None = None
    rows: list[dict[str, Any]] = field(default_factory=list)

    def recall(self, record: "Contacts") -> None:
        """Take in what a record has of the same session, in front of what is known."""
        self.session, known = record.session, {_stroke(row) for row in self.rows}
        self.rows = [dict(r) for r in record.rows if _stroke(r) not in known] + self.rows
        self.by, self.bands = self.by or record.by, self.bands or record.bands

    def touch(self, row: Row, held: Held | None) -> bool:
        """Take in a contact, and by what it was made if that is known; say whether it is new."""
        if held is not None:
            self.by, self.bands = held.session, held.bands
        fresh = _stroke(row) not in {_stroke(r) for r in self.rows}
        if fresh:
            self.rows.append(dict(row))
        return fresh

    def told(self, held: Held) -> dict[str, Any]:
        """Return the section; with nothing touched yet the bands are those of the present pose."""
        older = held.session is None or self.by != held.session
        earlier = held.if_heard(older) if self.rows else False
        bands = self.bands if self.rows else held.bands
        return {"session": self.session, "rows": self.rows, "bands": bands, "earlier": earlier}


def _stroke(row: Row) -> tuple[Any, Any]:
    return row["station_mm"], row["stroke"]
