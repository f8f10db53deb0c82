"""A wall clock that jumps, handed in: only what is written down for people follows it."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from legato.control.states import deadline
from legato.daemon.tidy import Tidy
from tests.unit.daemon.house import House

DAYS = (1, -1, 400, -400)


class Wall:
    """The time of day, as somebody has set it."""

    def __init__(self) -> None:
        self.now = datetime(2026, 3, 1, 22, 0, tzinfo=UTC)

    def __call__(self) -> datetime:
        """Return it."""
        return self.now

    def step(self, days: float) -> None:
        """Set it on, or back."""
        self.now += timedelta(days=days)


@pytest.fixture
def wall() -> Wall:
    """Give a clock."""
    return Wall()


@pytest.fixture
def house(tmp_path: Path, wall: Wall) -> Iterator[House]:
    """Give a cell whose records are dated by it."""
    made = House(tmp_path, wall=wall).known()
    yield made
    made.close()


@pytest.mark.parametrize("days", DAYS)
def test_deadlines_leases_and_heartbeats_do_not_follow_it(
    house: House, wall: Wall, days: int
) -> None:
    """In the middle of a job neither its state's time nor the lease's is up sooner or later."""
    token = house.result("lease", duration_s=50.0)["lease"]
    house.result("capture", lease=token)
    wall.step(days)
    limit = deadline("capture") or 0.0
    beats = len(house.of("heartbeat"))
    for _ in range(10):
        house.pass_time((limit - 1.0) / 10.0)
    assert len(house.of("heartbeat")) == beats + 10
    assert house.conductor.state == "capture"
    assert house.result("status")["lease"]["left_s"] == pytest.approx(51.0 - limit)
    wall.step(-days)
    house.pass_time(2.0)
    assert house.result("status")["fault"]["cause"] == "deadline"


@pytest.mark.parametrize("days", DAYS)
def test_sessions_stay_in_the_order_in_which_they_were_begun(
    house: House, wall: Wall, days: int
) -> None:
    """Each has its outcome and its own name, whatever the day is by then."""
    before = house.begin("home")
    house.end(before)
    wall.step(days)
    after = house.begin("home")
    house.end(after)
    listed = house.result("sessions")["sessions"]
    assert [told["id"] for told in listed] == [after, before]
    assert [told["outcome"] for told in listed] == ["done", "done"]


@pytest.mark.parametrize("days", DAYS)
def test_a_step_removes_no_record_of_the_newest(house: House, wall: Wall, days: int) -> None:
    """Retention goes by age, and leaves the latest alone whatever the clock says."""
    sessions = []
    for _ in range(3):
        sessions.append(house.begin("home"))
        house.end(sessions[-1])
    wall.step(days)
    tidy = Tidy(house.store, house.log, keep_days=90, keep_newest=2, min_free_mb=0, wall=wall)
    tidy()
    kept = {summary.id for summary in house.store.sessions()}
    assert len(kept & set(sessions)) >= 2
    assert kept == set(sessions) or days == 400
