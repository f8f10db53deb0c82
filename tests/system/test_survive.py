"""What befalls the real daemon from outside: kills, a full disk, a read-only folder, lost devices.

Each ends as designed: the arm stops or never starts, and what happened is written down.
"""

import os
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.system import judge
from tests.system.attacked import SERVE, SHORT, Attacked, Places, attacked
from tests.system.emulated import configuration
from tests.system.killing import kill
from tests.system.line import Line, ready_to_massage

NO_ROOT = (
    "import ctypes, os, sys; libc = ctypes.CDLL(None)\n"
    # CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH: root too is bound by what a folder allows.
    "[libc.prctl(24, cap, 0, 0, 0) for cap in (1, 2)]\n"
    "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
)
INFINITE = resource.RLIM_INFINITY


@contextmanager
def line_to(cell: Attacked) -> Iterator[Line]:
    """Give a client."""
    line = Line(cell.lines["requests"])
    try:
        yield line
    finally:
        line.close()


def in_state(line: Line, wanted: str) -> None:
    """Wait for a state."""
    until = time.monotonic() + 30.0
    while (state := line.do("status")["state"]) != wanted:
        assert time.monotonic() < until, f"{state}, never {wanted}"


def sound(cell: Attacked) -> None:
    """See that every record is sound, and that the log has no bug."""
    assert list(judge.records(judge.folders(cell.state_dir))) == []
    assert cell.logged("bug") == []
    assert cell.said() == []


def test_killed_at_any_moment_it_is_back_in_fault_interrupted(tmp_path: Path) -> None:
    """Started again at once it answers, knows what was broken off, and no record is damaged."""
    with attacked(tmp_path, SHORT, time_scale=200.0) as cell:
        told = kill(cell, 2, longest_s=0.6, jobs=("run",))
        assert told.wrong == []
        with line_to(cell) as line:
            line.do("reset")
        sound(cell)


def test_a_second_daemon_says_who_is_there_and_ends(tmp_path: Path) -> None:
    """It touches neither the first one's sockets nor its records."""
    with attacked(tmp_path, SHORT) as cell, line_to(cell) as line:
        boot = line.do("ping")["boot"]
        second = cell.second()
        assert second.returncode == 1
        assert f"another legato daemon (process {cell.process.pid})" in second.stderr
        assert "Traceback" not in second.stderr
        assert line.do("ping")["boot"] == boot


def test_a_disk_that_fills_up_is_a_fault_then_a_refusal_and_never_the_end(tmp_path: Path) -> None:
    """In a pass the arm comes off the leg first; of the log, on the same disk, only lines are lost.

    While there is no room jobs are refused; once there is, all goes on, and the outcome and the
    fault that could not be written are written after all.
    """
    with attacked(tmp_path, SHORT, time_scale=20.0) as cell, line_to(cell) as line:
        ready_to_massage(line)
        session = line.do("massage")["session"]
        in_state(line, "massage_7")
        resource.prlimit(cell.process.pid, resource.RLIMIT_FSIZE, (100, INFINITE))
        assert line.outcome(session) == "fault"
        status = line.do("status")
        assert (status["fault"]["cause"], status["fault"]["session"]) == ("disk", session)
        assert status["arm"]["contact"] is False
        line.do("reset")
        refused = line.ask("home")["error"]
        assert refused["message"] == "precondition"
        assert "free space" in refused["data"]["hint"]
        assert line.do("estop")["state"] == "fault"
        resource.prlimit(cell.process.pid, resource.RLIMIT_FSIZE, (INFINITE, INFINITE))
        since = line.do("status")["fault"]["since"]
        time.sleep(1.2)  # the next heartbeat writes what was owed
        cell.kill()
        cell.begin()
        line.again()
        assert line.do("status")["fault"]["since"] == since
        line.do("reset")
        assert line.outcome(line.do("home")["session"]) == "done"
        sound(cell)


def test_a_folder_that_becomes_read_only_is_a_refusal_with_a_hint(tmp_path: Path) -> None:
    """A job that runs takes no harm until it needs a new file; the next one does not begin."""
    before = (sys.executable, "-c", NO_ROOT)
    with attacked(tmp_path, SHORT, before=before) as cell, line_to(cell) as line:
        assert line.outcome(line.do("home")["session"]) == "done"
        for folder in (cell.state_dir / "sessions", cell.state_dir):
            folder.chmod(0o555)
        refused = line.ask("home")["error"]
        assert refused["message"] == "precondition"
        assert "writable" in refused["data"]["hint"]
        assert line.do("estop")["state"] == "fault"
        assert line.do("reset")["state"] == "idle"
        for folder in (cell.state_dir, cell.state_dir / "sessions"):
            folder.chmod(0o755)
        assert line.outcome(line.do("home")["session"]) == "done"
        sound(cell)


def test_nobody_reading_its_log_is_no_end(tmp_path: Path) -> None:
    """A pipe whose reader has gone takes no line; the daemon goes on, and ends cleanly."""
    places = Places()
    lines = places.lines
    config = configuration(tmp_path, {**SHORT, "server": lines})
    receive, send = os.pipe()
    with subprocess.Popen([sys.executable, *SERVE, str(config)], stderr=send) as process:
        os.close(send)
        os.close(receive)
        line = Line(lines["requests"])
        try:
            assert line.outcome(line.do("home")["session"]) == "done"
            line.do("shutdown")
            process.wait(20.0)
        finally:
            line.close()
            process.kill()
            places.close()


def test_a_log_that_nobody_reads_holds_nobody_up(tmp_path: Path) -> None:
    """A pipe that is full: requests, jobs and stops are answered as ever, and it ends in order."""
    places = Places()
    lines = places.lines
    config = configuration(tmp_path, {**SHORT, "server": lines}, time_scale=400.0)
    receive, send = os.pipe()
    with subprocess.Popen([sys.executable, *SERVE, str(config)], stderr=send) as process:
        os.close(send)
        line, stops = Line(lines["requests"]), Line(lines["stop"])
        try:
            while line.do("status")["uptime_s"] < 1.0:  # until it has said that it listens
                time.sleep(0.05)
            for _ in range(1000):  # far more than the pipe's 64 kB of log
                line.send("session", session="x" * 128)
            assert line.drain(30.0) == []
            assert line.do("status")["state"] == "idle"
            assert stops.do("stop")["received"]
            assert line.outcome(line.do("home")["session"]) == "done"
            line.do("shutdown")
            process.wait(20.0)
            assert process.returncode == 0
        finally:
            line.close()
            stops.close()
            process.kill()
            places.close()
    with os.fdopen(receive, "rb") as stream:
        told = stream.read()
    assert len(told) >= 60_000, "it was full"
    assert b'"listening"' in told


def test_a_camera_unplugged_in_a_job_and_plugged_in_again(tmp_path: Path) -> None:
    """Asked again for a while, then fault `camera_lost`; while it is away reset says so.

    Then the same daemon takes pictures again. The arm stays referenced.
    """
    faults = [{"kind": "camera_lost", "call": 2, "for_s": 40.0}]
    with attacked(tmp_path, SHORT, time_scale=20.0, faults=faults) as cell, line_to(cell) as line:
        assert line.outcome(line.do("capture")["session"]) == "done"
        assert line.outcome(line.do("capture")["session"]) == "fault"
        status = line.do("status")
        assert status["fault"]["cause"] == "camera_lost"
        assert status["camera"]["connected"] is False
        assert line.ask("reset")["error"]["message"] == "unavailable"
        assert line.do("status")["state"] == "fault"
        until = time.monotonic() + 20.0
        while "error" in line.ask("reset"):
            assert time.monotonic() < until
            time.sleep(0.2)
        assert line.do("status")["arm"]["referenced"]
        assert line.outcome(line.do("capture")["session"]) == "done"
        sound(cell)


def test_an_arm_that_goes_while_nobody_uses_it(tmp_path: Path) -> None:
    """Found out by looking, shown in status, found again by itself; nothing is in fault for it."""
    faults = [{"kind": "arm_lost", "on": "read", "call": 3, "for_s": 30.0}]
    with attacked(tmp_path, SHORT, time_scale=20.0, faults=faults) as cell, line_to(cell) as line:
        until = time.monotonic() + 20.0
        while line.do("status")["arm"]["connected"]:
            assert time.monotonic() < until
            time.sleep(0.05)
        assert line.ask("home")["error"]["message"] == "unavailable"
        while not line.do("status")["arm"]["connected"]:
            assert time.monotonic() < until
            time.sleep(0.05)
        assert line.do("status")["state"] == "idle"
        assert line.outcome(line.do("home")["session"]) == "done"
        sound(cell)
