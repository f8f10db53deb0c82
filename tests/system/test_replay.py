"""Records drive their jobs again: the same decisions for every kind of end, a change is found.

The sessions are those of a real daemon; each test works on a copy.
"""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from legato.cli.exits import Exit
from legato.records.errors import RecordError
from legato.records.files import read_object
from legato.records.record import read_session
from legato.records.whole import verify_record
from legato.replay.replay import replay
from tests.system.process import Daemon, configuration, daemon
from tests.system.test_supervised import changed
from tests.unit.cli.samples import document, run

SHORT: dict[str, Any] = {
    "leg": {"stations_mm": [7.0, 67.0]},
    "massage": {"strokes": 1, "dwell_s": 0.1},
    "calibration": {"population": 60, "generations": 300},
}


def until(running: Daemon, *states: str) -> str:
    """Wait until the cell is in one of some states."""
    while (state := running.do("status")["state"]) not in states:
        pass
    return str(state)


def stopped(running: Daemon) -> str:
    """Massage, hold, go on, and stop in the end."""
    session = str(running.do("massage")["session"])
    until(running, "massage_7")
    running.do("pause")
    until(running, "paused")
    running.do("resume")
    until(running, "massage_7", "massage_67")
    running.do("stop")
    assert running.wait(session) == "stopped"
    return session


def broken_off(running: Daemon) -> str:
    """Massage, and take the job away by an emergency stop."""
    session = str(running.do("massage")["session"])
    until(running, "massage_67")
    running.do("estop")
    assert running.wait(session) == "fault"
    return session


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the folders of sessions that ended in every way."""
    folder = tmp_path_factory.mktemp("cell")
    found: dict[str, str] = {}
    faults = [{"kind": "stuck_open", "on": "step", "call": 1, "for_s": 1e6}]
    with daemon(changed(configuration(folder, seed=3, time_scale=60.0), **SHORT)) as running:
        found["done"] = running.do("run")["session"]
        assert running.wait(found["done"]) == "done"
        found["stopped"] = stopped(running)
        found["dropped"] = broken_off(running)
    file = changed(configuration(folder, seed=3, time_scale=60.0, faults=faults), **SHORT)
    with daemon(file) as running:
        running.to_idle()
        found["fault"] = running.do("run")["session"]
        assert running.wait(found["fault"]) == "fault"
        found["killed"] = _killed(running)
    with daemon(file):
        pass  # closes the session of the one before
    return {name: folder / "state" / "sessions" / id_ for name, id_ in found.items()}


def _killed(running: Daemon) -> str:
    running.do("reset")
    session = str(running.do("run")["session"])
    until(running, "verify", "move_home", "massage_7")
    running.process.kill()
    running.process.wait()
    return session


@pytest.fixture
def copy(sessions: dict[str, Path], tmp_path: Path) -> Callable[[str], Path]:
    """Return a function that copies a session's folder, to be damaged."""

    def made(name: str) -> Path:
        path = tmp_path / "sessions" / sessions[name].name
        shutil.copytree(sessions[name], path)
        return path

    return made


@pytest.mark.parametrize("name", ["done", "stopped", "dropped", "fault", "killed"])
def test_the_same_record_gives_the_same_decisions(sessions: dict[str, Path], name: str) -> None:
    """Whether it ended by itself, by an operator, by the leg that was not there, or by force."""
    record = read_session(sessions[name])
    found = replay(record)
    assert found.same, (found.where, found.recorded, found.replayed)
    assert found.effects == sum("effect" in line for line in record.effects)
    ends = {"stopped": "stopped", "done": "done", "fault": "fault"}
    assert found.end == ends.get(name, "broken off")
    assert verify_record(sessions[name]).ok


def lines(path: Path, change: Callable[[list[Any]], None]) -> None:
    """Change the JSON lines of a file."""
    decoded = [msgspec.json.decode(line) for line in path.read_bytes().splitlines()]
    change(decoded)
    path.write_bytes(b"".join(msgspec.json.encode(line) + b"\n" for line in decoded))


def contact(path: Path) -> None:
    """Let the record have touched elsewhere."""

    def change(events: list[Any]) -> None:
        event = next(e for e in events if e["kind"] == "contact")
        event["data"]["contact_mm"] += 0.01

    lines(path / "events.jsonl", change)


def half_step(path: Path) -> None:
    """Let one motor have been sent one half-step further."""
    file = path / "trajectory.csv"
    rows = file.read_text().splitlines()
    cells = rows[40].split(",")
    cells[2] = str(int(cells[2]) + 1)
    file.write_text("\n".join([*rows[:40], ",".join(cells), *rows[41:]]) + "\n")


def switch(path: Path) -> None:
    """Let the arm have said that it touches, where it did not."""

    def change(effects: list[Any]) -> None:
        moves = [e for e in effects if e.get("effect") == "Move" and not e["answer"]["contact"]]
        moves[len(moves) // 2]["answer"]["contact"] = True

    lines(path / "effects.jsonl", change)


def figure(path: Path) -> None:
    """Let the calibration have found another camera."""
    found = read_object(path / "calibration.json")
    found["alpha_u"] += 0.01
    (path / "calibration.json").write_bytes(msgspec.json.encode(found))


def limit(path: Path) -> None:
    """Let the configuration have allowed less than the calibration showed."""
    meta = read_object(path / "session.json")
    meta["config"]["calibration"]["max_rms_px"] = 1e-6
    (path / "session.json").write_bytes(msgspec.json.encode(meta))


def outcome(path: Path) -> None:
    """Let the session have ended otherwise."""
    meta = read_object(path / "session.json") | {"outcome": "stopped"}
    (path / "session.json").write_bytes(msgspec.json.encode(meta))


def shorter(path: Path) -> None:
    """Let the last answers be lost."""
    file = path / "effects.jsonl"
    file.write_bytes(b"".join(file.read_bytes().splitlines(keepends=True)[:-5]))


@pytest.mark.parametrize(
    ("change", "where"),
    [
        (contact, "contact), contact_mm"),
        (half_step, "trajectory row 40, commanded, 2"),
        (switch, "trajectory row"),
        (figure, "calibration.json, alpha_u"),
        (limit, "end after effect"),
        (outcome, "session.json, outcome"),
        (shorter, "effects.jsonl, line"),
    ],
)
def test_whatever_is_changed_the_first_difference_is_named(
    copy: Callable[[str], Path], change: Callable[[Path], None], where: str
) -> None:
    """One number in any of its files: the replay says where, what stood there, and what should."""
    path = copy("done")
    change(path)
    found = replay(read_session(path))
    assert not found.same
    assert found.where is not None
    assert where in found.where
    assert found.recorded != found.replayed


def test_the_command_line_verifies_and_replays(copy: Callable[[str], Path]) -> None:
    """Exit 0 and the JSON document for a record that is sound, 1 and the place for one that is not.

    `legato sessions ID` still shows one session.
    """
    path = copy("done")
    where = ("--state-dir", path.parents[1])
    shown = run("sessions", path.name, *where, "--json")
    assert document(shown)["outcome"] == "done"
    verified = run("sessions", "--json", "verify", *where)
    assert verified.exit_code == 0
    assert [(r["id"], r["ok"]) for r in document(verified)] == [(path.name, True)]
    replayed = run("sessions", "replay", path.name, *where)
    assert replayed.exit_code == 0
    assert "the same decisions again" in replayed.stdout
    contact(path)
    verified = run("sessions", "verify", path.name, *where)
    assert verified.exit_code == Exit.FAILED
    assert "BROKEN" in verified.stdout
    assert "is changed" in verified.stdout
    replayed = run("sessions", "replay", path.name, *where, "--json")
    assert replayed.exit_code == Exit.FAILED
    assert "contact_mm" in document(replayed)["where"]


def test_a_record_that_cannot_be_replayed_says_why(copy: Callable[[str], Path]) -> None:
    """One of an older version, or one whose picture is gone."""
    path = copy("done")
    (path / "frames" / "verify.png").unlink()
    with pytest.raises(RecordError, match=r"lacks its picture frames/verify\.png"):
        replay(read_session(path))
    (path / "start.json").unlink()
    with pytest.raises(RecordError, match=r"has no start\.json"):
        replay(read_session(path))
