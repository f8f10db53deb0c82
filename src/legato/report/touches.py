"""Contacts as they are counted: a stroke counts once, by its last contact.

A stroke that a pause broke off is made again as a whole; its earlier contact is listed and not
counted. A touch that ended the session in a fault is none of its strokes'.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from legato.records.record import SessionRecord

Row = dict[str, Any]
EARLY = "contact_early"


def contacts(record: SessionRecord) -> list[Row]:
    """Return each contact in order, heights in the robot base frame.

    `counts` says whether it is its stroke's last, `again` whether the stroke was made anew.
    """
    rows = [dict(e["data"]) for e in record.of_kind("contact")]
    keys = [(r.get("station_mm"), r.get("kind"), r.get("stroke", i)) for i, r in enumerate(rows)]
    for i, row in enumerate(rows):
        row |= {"counts": keys[i] not in keys[i + 1 :], "again": keys[i] in keys[:i]}
    return rows


def counted(rows: Sequence[Row]) -> list[Row]:
    """Return one contact for each stroke."""
    return [row for row in rows if row["counts"]]


def ended_by(record: SessionRecord) -> Row | None:
    """Return the touch above the surface that ended the session, None where none did.

    `height_mm` is over the predicted surface; the heights z are None without a pose.
    """
    for event in record.of_kind("fault"):
        told = event["data"].get("evidence") or {}
        if event["data"].get("cause") != EARLY:
            continue
        match told:
            case {"station_mm": int() | float() as station, "height_mm": int() | float() as height}:
                heights = _heights(record.calibration or {}, station, height)
                return {"station_mm": float(station), "height_mm": float(height), **heights}
    return None


def _heights(solved: Mapping[str, Any], station: float, height: float) -> Row:
    """Return the predicted z of a station, and z at a height over it along the normal."""
    for row in solved.get("stations") or ():
        if float(row["station_mm"]) == station:
            place = np.asarray(row["place_mm"], dtype=float)
            touched = place + height * np.asarray(row["normal"], dtype=float)
            return {"predicted_z_mm": float(place[2]), "touched_z_mm": float(touched[2])}
    return {"predicted_z_mm": None, "touched_z_mm": None}
