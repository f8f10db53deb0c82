"""The one definition of how far a touch may lie from its prediction."""

import pytest

from legato.control.band import SIGMAS, Band, band, bands


def test_what_is_expected_and_what_is_accepted_stay_apart() -> None:
    """Two standard deviations of the station's own estimate, and the contact window."""
    assert band(67.0, 0.1, 2.0) == Band(67.0, 0.1, SIGMAS * 0.1, 2.0)
    assert SIGMAS == 2.0


def test_what_is_not_known_is_not_made_up() -> None:
    """A station without an estimate has no expected band, a record without a window none."""
    assert band(67.0, None, 2.0).expected_mm is None
    assert band(67.0, 0.1, None).accepted_mm is None


def test_a_calibrations_stations_give_a_band_each() -> None:
    """In their order, by the names of calibration.json and of status."""
    rows = [{"station_mm": 7, "sigma_mm": 0.1}, {"station_mm": 67.0}]
    assert [b.told() for b in bands(rows, 2.0)] == [
        {"station_mm": 7.0, "sigma_mm": 0.1, "expected_mm": pytest.approx(0.2), "accepted_mm": 2.0},
        {"station_mm": 67.0, "sigma_mm": None, "expected_mm": None, "accepted_mm": 2.0},
    ]
