"""The bands about each station's prediction: those that the record tells, and no others."""

from collections.abc import Iterable

from legato.control.band import Band, band, bands
from legato.records.record import SessionRecord
from legato.report.touches import contacts, ended_by


def contact_bands(record: SessionRecord) -> dict[float, Band]:
    """Return each station's band; of a station without an estimate the accepted one alone."""
    window = ((record.meta.get("config") or {}).get("massage") or {}).get("contact_window_mm")
    stations = (record.calibration or {}).get("stations") or ()
    found = {b.station_mm: b for b in bands(stations, window)}
    ended = ended_by(record)
    for row in [*contacts(record), *([ended] if ended else [])]:
        place = float(row["station_mm"])
        found.setdefault(place, band(place, None, window))
    return found


def descent(record: SessionRecord) -> float:
    """Return the step of the guarded descent in mm, 0 where the configuration tells none."""
    step = ((record.meta.get("config") or {}).get("massage") or {}).get("descent_mm")
    return float(step) if isinstance(step, int | float) else 0.0


def bands_told(found: Iterable[Band]) -> str:
    """Return what the bands about the prediction are, those that there are."""
    found = list(found)
    names = [
        "what the estimate of the pose leaves open (predicted)"
        if any(b.expected_mm for b in found) else "",
        "the contact window beyond which a touch is a fault (accepted)"
        if any(b.accepted_mm for b in found) else "",
    ]  # fmt: skip
    told = [name for name in names if name]
    many = {1: "one band", 2: "two bands"}.get(len(told), "no band")
    return f"Each station has {many} about the prediction" + (
        f": {', and '.join(told)}." if told else "."
    )
