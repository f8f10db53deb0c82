"""Commands that talk to the daemon: what is asked, what is shown, how they end."""

import json
import os
import signal
from pathlib import Path
from typing import Any

import pytest

from legato.cli.exits import Exit
from legato.daemon.client import RpcError
from tests.unit.cli.samples import Event, FakeDaemon, document, run, write_cell

STATUS: dict[str, Any] = {
    "state": "massage_67", "simulated": True, "session": "s1", "station": 67.0, "uptime_s": 12.0,
    "version": "0.1.0", "fault": None, "camera": {"connected": True, "age_s": 0.5},
    "arm": {"connected": True, "referenced": True, "xyz_mm": [1.0, 2.0, 3.0], "contact": False},
    "calibration": {"valid": True, "age_s": 3.0},
}  # fmt: skip
FAULT = {"cause": "contact_late", "text": "no contact", "hint": "look", "since": "", "session": 1}


def event(topic: str, seq: int, **data: Any) -> Event:
    """Return one event as the daemon sends it."""
    return topic, {"boot": "b", "seq": seq, "t": float(seq), "session": "s1", **data}


OLD = event("contact", 9, station_mm=187.0, contact_mm=0.5)
BATCHES = [
    [
        (OLD[0], OLD[1] | {"session": "s0"}),
        event("state", 1, state="capture", previous="idle", cause=None),
        event("state", 2, state="massage_7", previous="verify", cause=None),
        event("progress", 3, text="stroke 1 at 7 mm", station_mm=7.0, stroke=1, done=1, total=2),
    ],
    [
        event("contact", 4, station_mm=7.0, stroke=1, contact_mm=-0.25, place_mm=7.1),
        event("heartbeat", 5, uptime_s=3),
        event("session", 6, id="s1", job="run", outcome="done", reason=None),
    ],
]


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """Return a simulated cell's file."""
    return write_cell(tmp_path)


def job(outcome: str, reason: str | None = None) -> FakeDaemon:
    """Return a daemon on which a job runs and ends."""
    return FakeDaemon(
        answers={"run": {"session": "s1", "state": "capture"}},
        batches=BATCHES,
        outcome={"session": "s1", "state": "idle", "outcome": outcome, "reason": reason},
    )


def test_a_job_is_followed_to_its_end(cell: Path) -> None:
    """Progress by state and station goes to stderr, the outcome to stdout, and the line closes."""
    daemon = job("done")
    result = run("run", "--config", cell, "--key", "k1", daemon=daemon)
    assert result.exit_code == 0
    assert daemon.asked[0] == ("run", {"key": "k1"})
    for part in ("massage_7", "stroke 1 at 7 mm (1/2)", "touched at 7 mm, -0.25 mm"):
        assert part in result.stderr
    assert "uptime" not in result.stderr
    assert "187" not in result.stderr
    assert "run: done" in result.stdout
    assert daemon.closed


@pytest.mark.parametrize(
    ("outcome", "code"),
    [
        ("done", Exit.DONE),
        ("stopped", Exit.FAILED),
        ("refused", Exit.REFUSED),
        ("fault", Exit.FAULT),
        ("interrupted", Exit.FAULT),
    ],
)
def test_a_jobs_outcome_is_the_exit_code(cell: Path, outcome: str, code: Exit) -> None:
    """Each outcome has its code, and the reason is told; stdout is one JSON document."""
    result = run("run", "--config", cell, "--json", daemon=job(outcome, "because"))
    assert result.exit_code == code
    assert document(result) == {
        "session": "s1", "state": "idle", "outcome": outcome, "reason": "because",
    }  # fmt: skip
    assert "because" in result.stderr


@pytest.mark.parametrize("name", ["run", "calibrate"])
def test_picks_go_to_the_daemon_as_they_stand_in_the_file(
    cell: Path, tmp_path: Path, name: str
) -> None:
    """Marks named by a person are sent with the job; the daemon says which the leg has."""
    picks = tmp_path / "picks.csv"
    picks.write_text("name,u,v\nP1,100.5,200\nP2,300,400\n")
    daemon = job("done")
    daemon.answers = {name: {"session": "s1", "state": "calibrate"}}
    assert run(name, "--config", cell, "--picks", picks, daemon=daemon).exit_code == 0
    asked, params = daemon.asked[0]
    assert (asked, params) == (name, {"picks": {"P1": (100.5, 200.0), "P2": (300.0, 400.0)}})


def test_picks_that_cannot_be_read_are_said_before_anything_is_asked(
    cell: Path, tmp_path: Path
) -> None:
    """Exit 2 with what a file of picks looks like; and a job that finds no leg takes none."""
    picks = tmp_path / "picks.json"
    picks.write_text('{"P1": [1]}')
    daemon = job("done")
    result = run("calibrate", "--config", cell, "--picks", picks, daemon=daemon)
    assert result.exit_code == Exit.USAGE
    assert "expected [u, v]" in result.stderr
    assert daemon.asked == []
    assert "--picks" not in run("home", "--help").stdout
    assert "no such option" in run("home", "--picks", picks).stderr.lower()


def test_no_wait_returns_at_once(cell: Path) -> None:
    """With --no-wait the session's id is the answer and nothing is awaited."""
    daemon = job("done")
    result = run("run", "--config", cell, "--no-wait", "--json", daemon=daemon)
    assert (result.exit_code, document(result)["session"]) == (0, "s1")
    assert [m for m, _ in daemon.asked] == ["run"]


def test_ctrl_c_asks_for_a_stop_and_waits_for_the_end(cell: Path) -> None:
    """A first Ctrl-C is a request to stop, said on stderr; the outcome is still awaited."""
    daemon = job("stopped", "asked to")

    def interrupt(happened: Event) -> None:
        if happened[0] == "progress":
            os.kill(os.getpid(), signal.SIGINT)

    daemon.on_event = interrupt
    before = signal.getsignal(signal.SIGINT)
    result = run("run", "--config", cell, daemon=daemon)
    assert result.exit_code == Exit.FAILED
    assert daemon.methods == ["run", "stop"]
    assert "stopping" in result.stderr
    assert signal.getsignal(signal.SIGINT) is before


def test_a_second_ctrl_c_leaves(cell: Path) -> None:
    """A second Ctrl-C ends the command, not the job."""
    daemon = job("done")
    daemon.on_event = lambda _: os.kill(os.getpid(), signal.SIGINT)
    result = run("run", "--config", cell, daemon=daemon)
    assert result.exit_code == 1
    assert daemon.closed


def test_a_refused_job_says_why(cell: Path) -> None:
    """A refusal ends with 3 and shows reason, state and what to do."""
    no = RpcError(-32001, "precondition", {"reason": "not referenced", "hint": "reference it"})
    result = run("massage", "--config", cell, daemon=FakeDaemon({"massage": no}))
    assert result.exit_code == Exit.REFUSED
    assert "not referenced" in result.stderr
    assert "reference it" in result.stderr


@pytest.mark.parametrize(
    "name", ["pause", "resume", "stop", "estop", "reset", "shutdown", "reference"]
)
def test_requests_are_sent_as_they_are_named(cell: Path, name: str) -> None:
    """Each small command sends its own method once and shows the state."""
    daemon = FakeDaemon({name: {"session": None, "state": "idle"}})
    result = run(name, "--config", cell, "--json", daemon=daemon)
    assert (result.exit_code, daemon.asked) == (0, [(name, {})])
    assert document(result)["state"] == "idle"


def test_reference_carries_the_pose(cell: Path) -> None:
    """Only what is given is sent, so that the daemon's own defaults hold for the rest."""
    daemon = FakeDaemon()
    run("reference", "--config", cell, "--xyz", "127", "0", "150", "--pitch", "-90", daemon=daemon)
    assert daemon.asked == [("reference", {"xyz_mm": [127.0, 0.0, 150.0], "pitch_deg": -90.0})]


def test_status_shows_the_cell(cell: Path) -> None:
    """State, session, arm, camera and calibration are told; JSON is the daemon's own answer."""
    result = run("status", "--config", cell, daemon=FakeDaemon({"status": STATUS}))
    assert result.exit_code == 0
    for part in ("massage_67 (simulated)", "(1.0, 2.0, 3.0) mm", "67 mm",
                 "verified, 3 s old by the cell's clock", "0.5 s ago by the cell's"):  # fmt: skip
        assert part in result.stdout
    json_result = run("status", "--config", cell, "--json", daemon=FakeDaemon({"status": STATUS}))
    assert document(json_result) == STATUS


def test_status_ends_with_4_in_fault(cell: Path) -> None:
    """A script can tell a fault by the code; a person sees cause and hint."""
    past: dict[str, Any] = {"session": None, "calibration": None, "arm": {}}
    answer = STATUS | past | {"state": "fault", "fault": FAULT}
    result = run("status", "--config", cell, daemon=FakeDaemon({"status": answer}))
    assert result.exit_code == Exit.FAULT
    for part in ("contact_late: no contact", "look", "not connected", "1, ended by the fault"):
        assert part in result.stdout


@pytest.mark.parametrize("name", ["status", "run", "stop", "estop", "watch", "reference"])
def test_without_a_daemon_the_code_is_5(cell: Path, name: str) -> None:
    """Where nothing answers, the command says so and how to start a daemon."""
    result = run(name, "--config", cell)
    assert result.exit_code == Exit.NO_DAEMON
    assert "legato serve" in result.stderr


def test_stop_works_although_the_configuration_is_broken_elsewhere(tmp_path: Path) -> None:
    """A typing error in another table must not keep anybody from stopping the arm."""
    daemon = FakeDaemon()
    file = write_cell(tmp_path, "[robot]\nsped = 1\n")
    assert run("estop", "--config", file, daemon=daemon).exit_code == 0
    assert daemon.methods == ["estop"]


def test_a_port_that_the_daemon_chooses_cannot_be_asked(tmp_path: Path) -> None:
    """With port * in the file a client cannot know the port, and says so."""
    file = write_cell(tmp_path, "[server]\nrequests = 'tcp://127.0.0.1:*'\n")
    result = run("status", "--config", file, daemon=FakeDaemon())
    assert result.exit_code == Exit.USAGE
    assert "server.requests" in result.stderr


def test_watch_prints_events_as_lines(cell: Path) -> None:
    """Events come one a line, behind both clocks; heartbeats only on request."""
    quiet = run("watch", "--config", cell, "--count", "5", daemon=job("done"))
    assert "the cell's clock" in quiet.stderr
    assert [line.split()[1] for line in quiet.stdout.splitlines()][:2] == ["9.000", "1.000"]
    assert [line.split()[2] for line in quiet.stdout.splitlines()] == [
        "contact", "state", "state", "progress", "contact",
    ]  # fmt: skip
    every = run("watch", "--config", cell, "--all", "--json", "--count", "7", daemon=job("done"))
    lines = [json.loads(line) for line in every.stdout.splitlines()]
    assert [line["seq"] for line in lines] == [9, 1, 2, 3, 4, 5, 6]
    assert lines[5]["topic"] == "heartbeat"


def test_watch_shows_what_telemetry_and_heartbeats_hold(cell: Path) -> None:
    """The arm's place stands in `arm`, unknown before it is referenced; heartbeats tell state."""
    arm = {"xyz_mm": [1.0, 2.25, 3.0], "contact": True}
    batch = [
        event("telemetry", 1, arm=arm, station_mm=67.0, why="press"),
        event("telemetry", 2, arm={"xyz_mm": None, "contact": False}, station_mm=None, why=None),
        event("heartbeat", 3, state="idle", uptime_s=12.3),
    ]
    result = run("watch", "--config", cell, "--all", "--count", "3", daemon=FakeDaemon({}, [batch]))
    first, second, third = result.stdout.splitlines()
    assert first.endswith("at 1.0, 2.2, 3.0 mm, press, station 67 mm, contact")
    assert second.endswith("place not known")
    assert third.endswith("idle, up 12 s")


def test_watch_ends_quietly_on_ctrl_c(cell: Path) -> None:
    """Ctrl-C is how a watch ends: code 0, no traceback."""
    daemon = job("done")
    daemon.on_event = lambda _: os.kill(os.getpid(), signal.SIGINT)
    result = run("watch", "--config", cell, daemon=daemon)
    assert (result.exit_code, daemon.closed) == (0, True)
