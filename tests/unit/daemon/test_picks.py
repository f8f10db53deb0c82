"""Picks on their way from the wire to the worker and the record."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from legato.daemon.orders import DoJob
from tests.unit.daemon.house import House


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    """Give a house whose devices are known."""
    made = House(tmp_path).known()
    yield made
    made.close()


def test_picks_reach_the_worker_and_the_record_with_who_gave_them(
    house: House, tmp_path: Path
) -> None:
    """session.json names the places and the client."""
    session = house.result("run", picks={"P1": [10.5, 20.25]})["session"]
    task = house.task()
    assert isinstance(task, DoJob)
    assert task.params["picks"] == {"P1": (10.5, 20.25)}
    (found,) = tmp_path.rglob(f"{session}/session.json")
    told = json.loads(found.read_text())
    assert told["params"] == {"picks": {"P1": [10.5, 20.25]}}
    assert told["by"] == "local"


@pytest.mark.parametrize(
    "picks", [{}, {"P99": [1.0, 2.0]}, {"P1": [1.0]}, {"P1": "x"}, {"": [1.0, 2.0]}, []]
)
def test_picks_that_mean_nothing_are_refused(house: House, picks: object) -> None:
    """Unknown marks, wrong shapes and none at all start nothing."""
    assert house.error("run", picks=picks)[1] == "invalid_params"
    assert house.result("sessions")["sessions"] == []


def test_only_what_finds_the_leg_takes_picks(house: House) -> None:
    """The other jobs have no such parameter."""
    for job in ("capture", "verify", "home", "massage"):
        assert house.error(job, picks={"P1": [1.0, 2.0]})[1] == "invalid_params"
