"""The known camera's date: intrinsics hold for so many days, and not before they were made."""

import numpy as np
import pytest

from legato.calibration.problem import CalibrationError
from legato.control.effects import Refused
from legato.control.perceive import perceive, refuse_outdated
from legato.hal.faults import Cause
from tests.unit.control.cell import cell_settings

MADE, DAY = 1.77e9, 86_400.0  # s since 1970, and of a day


@pytest.mark.parametrize(
    ("days", "why"),
    [(-2.0, "is dated 2 days from now"), (-0.9, ""), (0.0, ""), (30.0, ""),
     (30.1, "30 days old, 30 are allowed"), (9999.0, "9999 days old")],
)  # fmt: skip
def test_intrinsics_hold_from_their_date_for_their_days(days: float, why: str) -> None:
    """Up to the last day nothing is said; later, or more than a day before, it is refused."""
    settings = cell_settings(camera_dated_s=MADE, camera_days=30.0)
    now = MADE + days * DAY
    if not why:
        refuse_outdated(settings, now)
        return
    with pytest.raises(CalibrationError, match=why) as caught:
        refuse_outdated(settings, now)
    assert caught.value.hint


def test_a_camera_without_a_date_does_not_age() -> None:
    """Free intrinsics, and days without end, are never too old."""
    refuse_outdated(cell_settings(), 1e12)
    refuse_outdated(cell_settings(camera_dated_s=MADE), 1e12)


def test_the_cell_refuses_a_camera_that_is_too_old_before_it_looks() -> None:
    """The job is refused, not in fault, and the picture is not looked at."""
    settings = cell_settings(camera_dated_s=MADE, camera_days=30.0)
    blank = np.zeros((576, 768), dtype=np.uint8)
    with pytest.raises(Refused, match="60 days old") as caught:
        perceive(blank, settings, seed=1, now_s=MADE + 60.0 * DAY)
    assert caught.value.cause is Cause.CALIBRATION_REJECTED
