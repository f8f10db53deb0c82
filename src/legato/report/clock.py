"""The two clocks of a record: the wall's, which times of day come from, and the cell's.

Both run alike, but for a cell that is simulated throughout: `sim.time_scale` of its seconds pass
in one of the wall's. Where that is so, whoever shows seconds says whose they are.
"""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from legato.records.record import SessionRecord

SIMULATED = "sim"


def pace(record: "SessionRecord") -> float:
    """Return how many seconds of the cell passed in one of the wall's."""
    config = record.meta.get("config") or {}
    drivers = {_table(config, name).get("driver") for name in ("robot", "camera")}
    scale = _table(config, "sim").get("time_scale")
    if drivers != {SIMULATED} or not isinstance(scale, int | float) or not scale > 0.0:
        return 1.0
    return float(scale)


def cell_seconds(record: "SessionRecord") -> float | None:
    """Return how long the session took by the cell's clock, None without an event."""
    if not record.events:
        return None
    return float(record.events[-1]["t"]) - float(record.events[0]["t"])


def moment(wall: Any) -> datetime | None:
    """Return an ISO time, in UTC where it names no zone; None for anything else."""
    try:
        found = datetime.fromisoformat(str(wall))
    except ValueError:
        return None
    return found if found.tzinfo is not None else found.replace(tzinfo=UTC)


def day(wall: Any) -> str | None:
    """Return a time of day with its date for people, UTC; None for what is no time."""
    found = moment(wall)
    return None if found is None else found.astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def time_of_day(wall: Any) -> str | None:
    """Return a time of day in UTC to the millisecond, None for what is no time."""
    found = moment(wall)
    return None if found is None else f"{found.astimezone(UTC):%H:%M:%S.%f}"[:-3]


def _table(config: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return one table of a configuration, empty where there is none."""
    table = config.get(name)
    return table if isinstance(table, dict) else {}
