"""`legato demo`: the real daemon as a child, the whole job, and nothing left behind."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NoReturn, cast

import pytest

from legato.cli.command import Context, Services
from legato.cli.demo import derive, job, own_files, rounded
from legato.cli.exits import Exit
from legato.cli.output import Output
from legato.config.load import load
from legato.daemon.client import Client
from legato.daemon.lock import AlreadyRunning, only_instance
from legato.records.store import Store
from tests.unit.cli.samples import FakeDaemon, document, run, write_cell


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
    assert rounded(told) == told
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
    assert not list(out.glob(".demo-*"))


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
    file = tmp_path / "demo.toml"
    derive(loaded, file, tmp_path, 7, "paper")
    made = load(file)
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


def test_the_arm_is_referenced_where_it_truly_stands(tmp_path: Path) -> None:
    """Home may be elsewhere: the simulated arm begins at sim.arm_at_mm, and that is told."""
    table = "arm_at_mm = [140.0, 20.0, 160.0]\narm_pitch_deg = -85.0\narm_roll_deg = 3.0\n"
    loaded = load(write_cell(tmp_path, table))
    ended = {"outcome": "done", "session": "s1", "state": "idle"}
    daemon = FakeDaemon({"run": {"session": "s1"}, "status": {}}, outcome=ended)
    context = Context(None, Output(), Services())
    assert job(context, loaded, cast(Client, daemon)).outcome == "done"
    pose = {"xyz_mm": [140.0, 20.0, 160.0], "pitch_deg": -85.0, "roll_deg": 3.0}
    assert ("reference", pose) in daemon.asked


@pytest.mark.parametrize("outcome", ["fault", None, "done"])
@pytest.mark.parametrize("told", ["session", "state"])
def test_a_real_cells_records_are_left_alone(
    cell: Path, tmp_path: Path, outcome: str | None, told: str
) -> None:
    """A fault, an end and a reference that a real cell left are no demo's to reset."""
    store = Store(tmp_path / "state")
    started = "2026-11-22T01:00:00+00:00"
    real = told == "session"
    meta = {"job": "run", "params": {}, "started": started, "simulated": not real}
    writer = store.begin(meta)
    if outcome is not None:
        writer.finish(outcome, "why", "estop", started)
    store.save_state({"fault": None} if real else {"fault": None, "simulated": False})
    before = sorted(p.name for p in store.state_dir.rglob("*"))
    result = run("demo", "--config", cell, "--json")
    assert result.exit_code == Exit.USAGE, result.output
    error = document(result)["error"]
    assert "real cell" in error["text"]
    assert "--out DIR" in error["hint"]
    assert sorted(p.name for p in store.state_dir.rglob("*")) == before


def test_a_real_cells_fault_is_left_alone_behind_later_demos(cell: Path, tmp_path: Path) -> None:
    """The session of the latched fault tells, although the latest session is simulated."""
    store = Store(tmp_path / "state")
    ids = []
    for minute, simulated in ((0, False), (1, True)):
        started = f"2026-11-22T01:0{minute}:00+00:00"
        meta = {"job": "run", "params": {}, "started": started, "simulated": simulated}
        writer = store.begin(meta)
        writer.finish("fault", "why", "estop", started)
        ids.append(writer.id)
    store.save_state({"fault": {"cause": "estop", "session": ids[0]}})
    result = run("demo", "--config", cell)
    assert result.exit_code == Exit.USAGE
    assert ids[0] in result.stderr


def test_own_files_go_to_the_session_or_away(tmp_path: Path) -> None:
    """However a demo ends, its files are with its session, or gone where none began."""
    store = Store(tmp_path)
    (tmp_path / ".demo-999999999.log").touch()  # of a process that is no more
    with suppress(KeyboardInterrupt):
        interrupted(store, begin=False)
    assert not list(tmp_path.glob(".demo-*"))
    with suppress(KeyboardInterrupt):
        interrupted(store, begin=True)
    folder = tmp_path / "sessions" / store.sessions()[0].id
    assert (folder / "demo.toml").read_text() == "the configuration"
    assert (folder / "daemon.log").read_text() == "the log"
    assert not list(tmp_path.glob(".demo-*"))


def interrupted(store: Store, *, begin: bool) -> NoReturn:
    """Play a demo that a Ctrl-C ends before or in its session."""
    with own_files(store) as (config, log):
        config.write_text("the configuration")
        log.write_text("the log")
        if begin:
            store.begin({"job": "run", "started": "2026-11-22T01:00:00+00:00"})
        raise KeyboardInterrupt


def test_an_early_ctrl_c_ends_a_demo_in_one_line(cell: Path, tmp_path: Path) -> None:
    """While the daemon starts: code 1, one line, one JSON document, and no file is left."""
    out = tmp_path / "out"
    line = [sys.executable, "-m", "legato", "demo", "--config", str(cell), "--out", str(out)]
    demo = subprocess.Popen(
        [*line, "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    waited(lambda: bool(list(out.glob(".demo-*.log"))))
    demo.send_signal(signal.SIGINT)
    told, said = demo.communicate(timeout=30)
    assert demo.returncode == Exit.FAILED
    assert json.loads(told)["error"]["text"] == "interrupted"
    assert said == "legato: interrupted\n"
    assert not list(out.glob(".demo-*"))


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
