"""Old records go by themselves: at the start, daily, and soon where the disk runs short."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from legato.daemon.tidy import DAILY_S, SOON_S, Tidy
from legato.records.errors import RecordError
from legato.records.store import Store
from tests.unit.daemon.bench import Silent

NOW = datetime(2026, 11, 22, 12, tzinfo=UTC)


class Disk(Store):
    """A store whose disk is as full as the test says, and which counts how often it is pruned."""

    free = 1000.0
    pruned = 0

    def free_mb(self) -> float:
        """Return the room that is left."""
        return self.free

    def prune(
        self, keep_days: float, now: datetime, *, min_free_mb: float = 0.0, keep_newest: int = 0
    ) -> list[str]:
        """Count, then prune."""
        self.pruned += 1
        return super().prune(keep_days, now, min_free_mb=min_free_mb, keep_newest=keep_newest)


class House:
    """A store with sessions that ended so many days ago, and what tidies it."""

    def __init__(self, folder: Path, ages: tuple[float, ...] = ()) -> None:
        self.now, self.log, self.store = 0.0, Silent(), Disk(folder)
        for days in ages:
            when = (NOW - timedelta(days=days)).isoformat()
            self.store.begin({"job": "run", "started": when}).finish("done", None, None, when)
        self.tidy = Tidy(
            self.store,
            self.log,
            keep_days=90,
            keep_newest=1,
            min_free_mb=200.0,
            now=lambda: self.now,
            wall=lambda: NOW,
        )


def test_it_is_done_at_the_start_and_once_a_day(tmp_path: Path) -> None:
    """However often it is asked for; what a crash left goes at the start alone."""
    house = House(tmp_path, (100.0, 5.0))
    (house.store.folder / ".begun-x").mkdir()
    for hour in range(25):
        house.now = hour * 3600.0
        house.tidy()
        (house.store.folder / ".begun-y").mkdir(exist_ok=True)
    assert house.store.pruned == 2
    assert house.now == DAILY_S
    assert {p.name for p in house.store.folder.glob(".begun-*")} == {".begun-y"}
    assert len(house.store.sessions()) == 1
    assert [event for event, _ in house.log.lines] == ["pruned"]


def test_a_full_disk_is_cleared_soon(tmp_path: Path) -> None:
    """Not a day later; the newest stays, and that it did not suffice is said once."""
    house = House(tmp_path, (5.0, 4.0, 3.0))
    house.tidy()
    assert len(house.store.sessions()) == 3
    house.store.free = 10.0
    for second in range(1, int(3 * SOON_S)):
        house.now = float(second)
        house.tidy()
    assert len(house.store.sessions()) == 1
    assert house.store.pruned == 3
    assert [event for event, _ in house.log.lines] == ["pruned", "disk_short"]


def test_trouble_is_not_met_again_every_second(tmp_path: Path) -> None:
    """A folder that cannot be tidied raises once, then waits for its next turn."""
    (tmp_path / "sessions").touch()
    house = House(tmp_path)
    with pytest.raises(RecordError):
        house.tidy()
    house.tidy()
