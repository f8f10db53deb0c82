"""The stop line of the real daemon on the simulated cell: what reaches the arm after a stop."""

import json
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from legato.config.toml import dumps
from legato.daemon.client import Client
from legato.records.store import Store
from tests.system.process import Daemon, configuration, daemon


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the folder of the shared daemon."""
    return tmp_path_factory.mktemp("s")


@pytest.fixture(scope="module")
def shared(folder: Path) -> Iterator[Daemon]:
    """Give one daemon whose lines are files."""
    lines = {name: f"ipc://{folder}/{name}" for name in ("requests", "events", "stop")}
    with daemon(configuration(folder, lines, seed=1, time_scale=20.0)) as running:
        yield running


@pytest.fixture
def stops(shared: Daemon) -> Iterator[Client]:
    """Give a client of the stop line."""
    with Client(str(shared.logged("ready")[0]["stop"])) as client:
        yield client


def legato(*args: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a command."""
    command = [sys.executable, "-m", "legato", *map(str, args)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def moved(folder: Path, session: str) -> list[str]:
    """Return what each motion command of a session was for, as the record has it."""
    return list(Store(folder / "state").read(session).trajectory["why"])


def test_an_estop_in_a_pass_sends_nothing_more(shared: Daemon, stops: Client, folder: Path) -> None:
    """From the confirmation on no motion command goes to the arm, and the fault latches."""
    shared.ready_to_massage()
    session = shared.do("massage")["session"]
    shared.event("contact", station_mm=7.0)
    told = stops.call("estop", timeout_s=5.0)
    assert told["received"] <= told["commanded"] <= told["confirmed"]
    count = len(moved(folder, session))
    assert shared.wait(session) == "fault"
    assert len(moved(folder, session)) - count <= 1  # the row of the motion just confirmed
    fault = shared.do("status")["fault"]
    assert (fault["cause"], fault["session"]) == ("estop", session)


def test_a_stop_in_a_pass_retracts_and_ends_as_stopped(
    shared: Daemon, stops: Client, folder: Path
) -> None:
    """After the motion in flight there is the retract, and nothing else."""
    shared.ready_to_massage()
    session = shared.do("massage")["session"]
    shared.event("contact", station_mm=7.0)
    assert stops.call("stop", timeout_s=5.0)["confirmed"] is not None
    count = len(moved(folder, session))
    assert shared.wait(session) == "stopped"
    assert set(moved(folder, session)[count + 1 :]) <= {"retract"}
    meta = json.loads((folder / "state" / "sessions" / session / "session.json").read_text())
    assert (meta["outcome"], meta["by"]) == ("stopped", "local")


def test_stopping_during_a_solve_is_not_held_up(shared: Daemon, stops: Client) -> None:
    """While the computer is busy with the search, the line answers and the job ends."""
    shared.ready_to_massage()
    session = shared.do("calibrate")["session"]
    assert stops.call("ping")["state"] in ("calibrate", "idle")
    assert stops.call("estop")["confirmed"] is not None
    assert shared.wait(session) in ("fault", "done")


def test_a_search_that_would_last_for_hours_ends_at_a_stop(tmp_path: Path) -> None:
    """The job ends as stopped, long before the state's deadline, and the next can begin."""
    config = configuration(tmp_path, seed=1)
    data = tomllib.loads(config.read_text())
    data["calibration"] |= {"engine": "paper", "population": 10_000, "generations": 100_000}
    config.write_text(dumps(data, "Made by a test."))
    with daemon(config) as cell:
        cell.wait(cell.do("capture")["session"])
        session = cell.do("calibrate")["session"]
        cell.event("state", state="calibrate")
        cell.event("telemetry")  # the search begins
        cell.do("stop")
        assert cell.wait(session) == "stopped"
        assert cell.wait(cell.do("home")["session"]) == "done"


def test_the_commands_go_the_stop_line(shared: Daemon, folder: Path) -> None:
    """`legato stop` and `estop` print when they were confirmed, and work with one line alone."""
    shared.ready_to_massage()
    config = folder / "cell.toml"
    session = shared.do("massage")["session"]
    shared.event("contact", station_mm=7.0)
    stopped = legato("stop", "--config", config, "--json")
    assert stopped.returncode == 0, stopped.stderr
    answer: dict[str, Any] = json.loads(stopped.stdout)
    assert answer["method"] == "stop"
    assert answer["confirmed"] >= answer["received"]
    assert shared.wait(session) == "stopped"
    estopped = legato("estop", "--config", config)
    assert estopped.returncode == 0
    assert "estop confirmed: state fault" in estopped.stdout
    shared.do("reset")
    told = [line["method"] for line in shared.logged("stop_line")]
    assert told[-2:] == ["stop", "estop"]
