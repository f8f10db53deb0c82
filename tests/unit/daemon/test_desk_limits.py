"""What the desk does with more than it can take: huge numbers, and too many who wait."""

import math
from typing import Any

import pytest

from legato.daemon.orders import DoReference, DoReset
from legato.daemon.waiters import MOST, Ask
from legato.daemon.who import LOCAL
from legato.wire.jsonrpc import Call
from tests.unit.daemon.house import CAMERA_LOST, House


@pytest.mark.parametrize(
    "far", [{"xyz_mm": [1e308, 0.0, 1e200]}, {"pitch_deg": -1e308}, {"roll_deg": 1e300}]
)
def test_a_huge_number_is_refused_in_few_words(house: House, far: dict[str, Any]) -> None:
    """It comes back as it may be read, not with three hundred digits."""
    code, _, reason = house.error("reference", **far)
    assert code == -32602
    assert len(reason) < 80
    code, name, reason = house.error("home", expires_at=-1e308)
    assert (name, reason) == ("expired", "it came 1e+308 s after its expires_at")


@pytest.mark.parametrize("method", ["reset", "reference"])
def test_what_cannot_be_answered_later_is_not_done(house: House, method: str) -> None:
    """Where too many wait already, the worker is asked for nothing."""
    if method == "reset":
        house.end(house.begin(), "fault", CAMERA_LOST)
    for _ in range(MOST):
        house.desk._waiters.add(Ask(Call((b"x",), "wait"), LOCAL, 0), ("session", "x"), math.inf)
    assert house.error(method)[1] == "unavailable"
    assert house.task() is None
    house.desk._waiters.take_all()
    assert house.ask(method) is None
    assert isinstance(house.task(), DoReset | DoReference)
