"""A campaign driven by hand in a house."""

import json
from typing import Any

from legato.daemon.messages import FaultReport
from legato.daemon.orders import DoJob
from tests.unit.daemon.house import House


def begin(house: House, **asked: Any) -> tuple[str, str]:
    """Begin a campaign; return its id and its first session, which the worker has taken."""
    told = house.result("campaign", **asked)
    assert taken(house) == told["session"]
    return told["campaign"], told["session"]


def taken(house: House) -> str | None:
    """Return the session of the job that the worker is given next, None where there is none."""
    task = house.task()
    assert task is None or isinstance(task, DoJob)
    return task.session if task is not None else None


def campaign(house: House) -> dict[str, Any]:
    """Return what status tells of the campaign."""
    found: dict[str, Any] = house.result("status")["campaign"]
    return found


def summary(house: House, name: str) -> dict[str, Any]:
    """Return a campaign's document as it stands on the disk."""
    path = house.store.state_dir / "campaigns" / f"{name}.json"
    found: dict[str, Any] = json.loads(path.read_text())
    return found


def repetition(house: House, fault: FaultReport | None = None) -> str:
    """Let the next repetition begin and end; return its session."""
    house.pass_time(0.0)
    session = taken(house)
    assert session is not None
    house.end(session, None if fault else "done", fault)
    return session
