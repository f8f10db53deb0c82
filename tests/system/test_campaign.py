"""Campaigns over the real daemon with faults that it is not told of: repeated, reset, stopped."""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from tests.system.process import Daemon, configuration, daemon

HIGH: dict[str, Any] = {
    "arm_at_mm": [127.0, 0.0, 220.0]
}  # the way home from here is some dozen motions


def lines(folder: Path) -> dict[str, str]:
    """Return lines that a daemon has again after a restart, and that a command finds."""
    return {name: f"ipc://{folder}/{name}" for name in ("requests", "events", "stop")}


def ended(running: Daemon, name: str) -> dict[str, Any]:
    """Return a campaign's summary once it has ended."""
    for _ in range(600):
        summary = running.do("campaigns", campaign=name)
        if summary["ended"] is not None:
            return summary
        time.sleep(0.05)
    raise AssertionError(f"the campaign has not ended: {running.do('status')['campaign']}")


def rows(folder: Path, session: str, name: str = "trajectory.csv") -> int:
    """Return how many motions a session's record has."""
    path = folder / "state" / "sessions" / session / name
    return len(path.read_text().splitlines()) if path.exists() else 0


def still(running: Daemon, seconds: float = 0.5) -> None:
    """See that nothing begins and nothing moves for a while."""
    before = running.do("sessions")["sessions"], running.do("status")["arm"]
    time.sleep(seconds)
    assert (running.do("sessions")["sessions"], running.do("status")["arm"]) == before


def test_a_campaign_of_three_outlives_a_camera_that_fails(tmp_path: Path) -> None:
    """One failed grab is asked again and nobody is disturbed; a camera that is away is reset.

    The command prints the summary that is on the disk.
    """
    faults: list[dict[str, Any]] = [
        {"kind": "camera_lost", "call": 2},
        {"kind": "camera_stale", "call": 4, "for_s": 150.0},
    ]
    config = configuration(tmp_path, lines(tmp_path), time_scale=50.0, faults=faults)
    with daemon(config) as running:
        command = [sys.executable, "-m", "legato", "campaign", "--config", str(config), "--json"]
        command += ["--job", "capture", "--count", "3", "--resets", "5"]
        said = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
        summary = json.loads(said.stdout)
        assert said.returncode == 4, said.stderr
        assert [row["outcome"] for row in summary["sessions"]] == ["done", "done", "fault"]
        assert summary["outcome"] == "fault", "nothing is reset after the last repetition"
        kept = tmp_path / "state" / "campaigns" / f"{summary['id']}.json"
        assert json.loads(kept.read_text()) == {k: v for k, v in summary.items() if k != "left_out"}
        second = summary["sessions"][1]["id"]
        events = tmp_path / "state" / "sessions" / second / "events.jsonl"
        retries = [
            json.loads(line)["data"].get("retry") for line in events.read_text().splitlines()
        ]
        assert [r["cause"] for r in retries if r] == ["camera_lost"]

        running.do("reset")
        name = running.do("campaign", job="capture", count=9, resets=9)["campaign"]
        summary = ended(running, name)
        assert summary["outcome"] == "done"
        assert summary["failed"] == len(summary["resets_done"]) >= 1
        assert {f["cause"] for f in summary["faults"]} == {"camera_stale"}
        fault = running.event("fault", cause="camera_stale")
        assert {"state", "arm", "last_effects", "last_bytes", "picture"} <= fault["evidence"].keys()
        assert fault["evidence"]["state"] == "capture"
        assert fault["evidence"]["last_effects"][-1].startswith("Grab")
        assert running.do("status")["state"] == "idle"


def test_an_arm_fault_ends_it_at_once(tmp_path: Path) -> None:
    """However many resets were allowed: the motion is not tried again, the fault stays latched."""
    faults: list[dict[str, Any]] = [{"kind": "arm_timeout", "call": 5, "by": 0.5}]
    config = configuration(tmp_path, time_scale=20.0, faults=faults, **HIGH)
    with daemon(config) as running:
        name = running.do("campaign", job="home", count=3, resets=9)["campaign"]
        summary = ended(running, name)
        assert (summary["outcome"], summary["failed"]) == ("fault", 1)
        assert summary["reason"].startswith("arm_timeout")
        (row,) = summary["sessions"]
        fault = running.event("fault", cause="arm_timeout")
        assert fault["evidence"]["last_effects"][-1].startswith("Move")
        assert rows(tmp_path, row["id"]) == 1 + 1 + 4  # heading, where it stood, four motions
        still(running)
        status = running.do("status")
        assert (status["state"], status["arm"]["referenced"]) == ("fault", False)


def test_a_stop_in_the_middle_and_a_daemon_that_dies(tmp_path: Path) -> None:
    """A stop ends job and campaign; killed, the next daemon knows of it and moves nothing."""
    at = lines(tmp_path)
    config = configuration(tmp_path, at, time_scale=4.0, **HIGH)
    with daemon(config) as running:
        told = running.do("campaign", job="home", count=50)
        running.event("telemetry")
        running.do("stop")
        assert running.wait(told["session"]) == "stopped"
        summary = ended(running, told["campaign"])
        assert (summary["outcome"], summary["done"]) == ("stopped", 0)
        still(running)
        told = running.do("campaign", job="home", count=50, every_s=2.0)
        running.event("session", outcome="done")
        running.event("state", state="move_home")
        running.process.kill()
        running.process.wait()
    with daemon(config) as running:
        status = running.do("status")
        assert status["campaign"]["id"] == told["campaign"]
        assert status["campaign"]["outcome"] == "interrupted"
        assert (status["state"], status["fault"]["cause"]) == ("fault", "interrupted")
        still(running)
        running.do("reset")
        still(running)
        name = running.do("campaign", job="capture", count=9, every_s=3600.0)["campaign"]
        running.event("campaign", what="session")
        running.process.kill()
        running.process.wait()
    with daemon(config) as running:
        status = running.do("status")
        assert (status["campaign"]["id"], status["campaign"]["outcome"]) == (name, "interrupted")
        assert status["state"] == "idle"
        still(running)
