"""How far a touch may lie from the prediction: the one definition for page, report and `watch`.

Two bands about a station's predicted surface, never merged into one. *Expected* is what the
estimate of the pose leaves open: SIGMAS standard deviations of that station's own estimate.
*Accepted* is the contact window: a touch beyond it is a fault. Name them by the words here.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

SIGMAS: Final = 2.0
EXPECTED: Final = "predicted, \N{PLUS-MINUS SIGN} 2 sigma"
ACCEPTED: Final = "accepted"


@dataclass(frozen=True)
class Band:
    """One station's half widths over and under the prediction, mm; None where not known."""

    station_mm: float
    sigma_mm: float | None
    expected_mm: float | None
    accepted_mm: float | None

    def told(self) -> dict[str, Any]:
        """Return it for the wire: the fields by name."""
        return vars(self).copy()


def band(station_mm: float, sigma_mm: float | None, window_mm: float | None) -> Band:
    """Return the band of a station whose estimate has the standard deviation `sigma_mm`.

    `window_mm` is `massage.contact_window_mm`.
    """
    expected = None if sigma_mm is None else SIGMAS * sigma_mm
    return Band(station_mm, sigma_mm, expected, window_mm)


def bands(stations: Iterable[Mapping[str, Any]], window_mm: float | None) -> list[Band]:
    """Return the bands of a calibration's `stations`: rows with station_mm and sigma_mm."""
    rows = [(float(s["station_mm"]), s.get("sigma_mm")) for s in stations]
    return [band(place, None if e is None else float(e), window_mm) for place, e in rows]
