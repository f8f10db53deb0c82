"""`legato demo`: the real daemon as a child, the whole job, and nothing left behind."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from legato.cli.demo import derived
from legato.cli.exits import Exit
from legato.config.load import load
from legato.daemon.lock import AlreadyRunning, only_instance
from legato.records.store import Store
from tests.unit.cli.samples import document, run, write_cell


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """Return a simulated cell's file."""
    return write_cell(tmp_path)


def test_the_whole_job_is_run_scored_and_reported(cell: Path, tmp_path: Path) -> None:
    """One document tells outcome, states, stations and pose error; record and report are kept."""
    out = tmp_path / "out"
    result = run("demo", "--config", cell, "--seed", "3", "--out", out, "--json")
    assert result.exit_code == 0, result.output
    told = document(result)
    assert told["outcome"] == "done"
    assert told["states"] == [
        "capture", "calibrate", "verify", "move_home",
        "massage_7", "massage_67", "massage_127", "massage_187", "move_home", "idle",
    ]  # fmt: skip
    assert [s["station_mm"] for s in told["stations"]] == [7.0, 67.0, 127.0, 187.0]
    assert all(0.0 < s["error_mm"] <= 0.8 for s in told["stations"])
    assert all(abs(s["place_mm"] - s["station_mm"]) <= 0.8 for s in told["stations"])
    assert told["pose_error"]["translation_mm"] < 0.5
    assert Path(told["report"]).stat().st_size > 10_000
    assert "massage_127" in result.stderr
    record = Store(out).read(told["session"])
    assert record.meta["simulated"]
    repeat = load(record.path / "demo.toml").config
    assert (repeat.sim.seed, repeat.sim.time_scale) == (3, 400.0)
    assert (record.path / "daemon.log").stat().st_size > 0
    assert not list(out.glob(".demo-*"))


def test_a_demo_whose_daemon_does_not_start_says_why(cell: Path, tmp_path: Path) -> None:
    """Another daemon on the same records is named; nothing is left running."""
    out = tmp_path / "out"
    with only_instance(out):
        result = run("demo", "--config", cell, "--out", out, "--json")
    assert result.exit_code == Exit.FAILED
    error = document(result)["error"]
    assert str(os.getpid()) in error["text"]
    assert "another legato daemon" in error["text"]


def test_a_real_cell_is_never_demonstrated(cell: Path) -> None:
    """A configuration with a real arm is refused before anything is started or written."""
    cell.write_text(cell.read_text() + "[robot]\ndriver = 'teachmover'\n")
    result = run("demo", "--config", cell)
    assert result.exit_code == Exit.USAGE
    assert "real" in result.stderr
    assert not (cell.parent / "state").exists()


def test_the_derived_configuration_differs_only_where_it_must(cell: Path, tmp_path: Path) -> None:
    """Seed, engine, ports and records are the demo's own; everything else is the cell's."""
    loaded = load(cell)
    made = load(derived(loaded, tmp_path, 7, "paper"))
    assert (made.config.sim.seed, made.config.calibration.engine) == (7, "paper")
    assert made.config.server.requests == "tcp://127.0.0.1:*"
    assert made.config.records.state_dir == str(tmp_path)
    untouched = ("robot", "camera", "cell", "leg", "massage")
    assert {k: made.data[k] for k in untouched} == {k: loaded.data[k] for k in untouched}


def test_the_daemon_ends_with_a_demo_that_is_killed(cell: Path, tmp_path: Path) -> None:
    """Even SIGKILL of the demo leaves no daemon: its lock is free again soon after."""
    out = tmp_path / "out"
    demo = subprocess.Popen(
        [sys.executable, "-m", "legato", "demo", "--config", str(cell), "--out", str(out)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    waited(lambda: bool(list(out.glob("sessions/*/events.jsonl"))))
    demo.kill()
    demo.wait(10)
    waited(lambda: is_free(out))


def is_free(state_dir: Path) -> bool:
    """Say whether no daemon holds a state folder."""
    try:
        with only_instance(state_dir):
            return True
    except AlreadyRunning:
        return False


def waited(holds: Callable[[], bool]) -> None:
    """Return once something holds; another process is at work, so only the wall clock helps."""
    for _ in range(1500):
        if holds():
            return
        time.sleep(0.02)
    raise AssertionError("not within half a minute")
