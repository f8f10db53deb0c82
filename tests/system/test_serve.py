"""The daemon as a process: a plain JSON-RPC client runs, pauses, stops and kills it."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import zmq

from legato.records.chain import verify_chain
from legato.records.record import read_session
from tests.system.process import ANY, Daemon, configuration, daemon

RUN = ["capture", "calibrate", "verify", "move_home", "massage_7", "massage_67", "massage_127",
       "massage_187", "move_home", "idle"]  # fmt: skip


@pytest.fixture(scope="module")
def state_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the folder of the shared daemon."""
    return tmp_path_factory.mktemp("cell")


@pytest.fixture(scope="module")
def shared(state_dir: Path) -> Iterator[Daemon]:
    """Give one daemon to all tests that leave it in idle."""
    with daemon(configuration(state_dir, seed=1, time_scale=20.0)) as running:
        yield running


def test_a_plain_client_runs_the_whole_job(shared: Daemon, state_dir: Path) -> None:
    """Status, run, wait; the states come in the designed order, and the record verifies."""
    status = shared.do("status")
    assert (status["state"], status["simulated"], status["fault"]) == ("idle", True, None)
    assert status["arm"]["connected"]
    assert status["camera"]["connected"]
    shared.heard.clear()
    begun = shared.do("run", key="first")
    assert begun["state"] == "capture"
    assert shared.do("run", key="first")["session"] == begun["session"]
    assert shared.error("home")["code"] == -32003
    answer = shared.do("wait", session=begun["session"], timeout_s=60)
    assert (answer["outcome"], answer["state"]) == ("done", "idle")
    shared.event("session", outcome="done")
    assert shared.states() == RUN
    seqs = [event["seq"] for _, event in shared.heard]
    assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
    contacts = [event for topic, event in shared.heard if topic == "contact"]
    assert [c["station_mm"] for c in contacts] == [s for s in (7, 67, 127, 187) for _ in range(3)]
    after = shared.do("status")
    assert after["calibration"]["valid"]
    assert after["session"] is None
    folder = state_dir / "state" / "sessions" / begun["session"]
    assert verify_chain(folder).ok
    assert {p.name for p in folder.iterdir()} >= {
        "session.json", "events.jsonl", "calibration.json", "trajectory.csv", "truth.json",
    }  # fmt: skip


def test_junk_on_both_sockets_leaves_it_unharmed(shared: Daemon) -> None:
    """Malformed messages are answered or dropped; status is unaffected."""
    dealer = shared.connected(zmq.DEALER, shared.requests)
    junk = [[b""], [b"", b"", b""], [b"\xff\xfe"], [b"["] * 9, [b"[" * 60_000], [b"x" * 70_000],
            [b'{"jsonrpc": "2.0", "id": NaN}'], [b"[{}]"], [b'{"id": {}}']]  # fmt: skip
    for number in range(300):
        dealer.send_multipart(junk[number % len(junk)])
    talker = shared.connected(zmq.XSUB, str(shared.logged("ready")[0]["events"]))
    for number in range(100):
        talker.send(bytes([number]) * 50)
    assert shared.do("status")["state"] == "idle"
    dealer.close()
    talker.close()


def test_pause_resume_and_stop_work_during_a_pass(shared: Daemon) -> None:
    """Paused the arm stands above the leg; resumed it goes on; stopped it is back in idle."""
    shared.ready_to_massage()
    session = shared.do("massage")["session"]
    shared.event("contact", station_mm=7.0)
    shared.do("pause")
    shared.event("state", state="paused")
    assert shared.do("status")["state"] == "paused"
    assert shared.error("pause")["code"] == -32000
    assert shared.error("home")["code"] == -32003
    assert shared.do("status")["arm"]["contact"] is False
    shared.do("resume")
    shared.event("state", state="massage_7")
    shared.event("contact", station_mm=67.0)
    assert shared.do("stop")["state"] == "stopping"
    assert shared.wait(session) == "stopped"
    status = shared.do("status")
    assert (status["state"], status["fault"]) == ("idle", None)
    assert status["arm"]["contact"] is False
    assert status["arm"]["referenced"]


def test_estop_during_a_pass_latches_until_reset(shared: Daemon, state_dir: Path) -> None:
    """After estop no motion is commanded, every job is refused, and reset alone leads to idle."""
    shared.ready_to_massage()
    session = shared.do("massage")["session"]
    shared.event("contact", station_mm=7.0)
    assert shared.do("estop")["state"] == "fault"
    rows = state_dir / "state" / "sessions" / session / "trajectory.csv"
    assert shared.wait(session) == "fault"
    moved = rows.read_bytes()
    assert shared.error("run")["code"] == -32004
    assert shared.error("home")["data"]["state"] == "fault"
    assert shared.error("resume")["code"] == -32004
    fault = shared.do("status")["fault"]
    assert (fault["cause"], fault["session"]) == ("estop", session)
    told = shared.event("fault", cause="estop")
    assert told["evidence"]["state"] == "massage_7"
    assert shared.do("reset")["state"] == "idle"
    assert rows.read_bytes() == moved
    assert shared.do("session", session=session)["outcome"] == "fault"
    if shared.do("status")["arm"]["referenced"]:
        assert shared.wait(shared.do("home")["session"]) == "done"


def test_what_does_not_fit_gets_its_designed_error(shared: Daemon) -> None:
    """Codes, names and data are those of the design."""
    shared.to_idle()
    for method, params, code in (
        ("pause", {}, -32000),
        ("resume", {}, -32000),
        ("stop", {}, -32000),
        ("reset", {}, -32000),
        ("fly", {}, -32601),
        ("status", {"all": True}, -32602),
        ("wait", {"session": "none"}, -32602),
        ("reference", {"xyz_mm": [5000, 0, 0]}, -32602),
    ):
        error = shared.error(method, **params)
        assert error["code"] == code, (method, error)
        assert error["data"]["state"] == "idle"
        assert error["data"]["reason"]


def test_a_second_daemon_is_refused(shared: Daemon, state_dir: Path) -> None:
    """One state folder has one daemon; the other says who has it and ends."""
    second = subprocess.run(
        [sys.executable, "-m", "legato", "serve", "--config", str(state_dir / "cell.toml")],
        capture_output=True, text=True, timeout=30, check=False,
    )  # fmt: skip
    assert second.returncode == 1
    assert str(shared.process.pid) in second.stderr
    assert shared.do("ping")


def test_a_port_that_is_taken_is_told(tmp_path: Path) -> None:
    """A daemon that cannot listen ends at once, with a line that says where."""
    config = configuration(tmp_path)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        endpoint = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        text = config.read_text(encoding="utf-8")
        config.write_text(text.replace(f'requests = "{ANY}"', f'requests = "{endpoint}"'))
        ended = subprocess.run(
            [sys.executable, "-m", "legato", "serve", "--config", str(config)],
            capture_output=True, text=True, timeout=30, check=False,
        )  # fmt: skip
    assert ended.returncode == 1
    (line,) = [json.loads(text) for text in ended.stderr.splitlines()]
    assert (line["event"], line["requests"]) == ("not_bound", endpoint)


def test_kill_and_restart_is_a_fault_without_motion(tmp_path: Path) -> None:
    """Killed in a pass, the next daemon closes the session as interrupted and waits for reset."""
    config = configuration(tmp_path, seed=2, time_scale=5.0)
    with daemon(config) as first:
        session = first.do("run")["session"]
        first.event("state", state="move_home")
        first.event("telemetry")
        first.process.kill()
        first.process.wait()
    with daemon(config) as second:
        status = second.do("status")
        assert status["state"] == "fault"
        assert (status["fault"]["cause"], status["fault"]["session"]) == ("interrupted", session)
        assert second.do("session", session=session)["outcome"] == "interrupted"
        assert second.error("run")["code"] == -32004
        assert second.do("reset")["state"] == "idle"
        assert not [topic for topic, _ in second.heard if topic == "telemetry"]
        record = tmp_path / "state" / "sessions" / session
        assert verify_chain(record).ok


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_signal_retracts_and_ends_cleanly(tmp_path: Path, name: str) -> None:
    """Told to end in a pass, be it by a terminal that goes, it stops the job and exits with 0."""
    config = configuration(tmp_path, seed=1, time_scale=20.0)
    with daemon(config) as running:
        session = running.do("run")["session"]
        running.event("contact", station_mm=7.0)
        os.kill(running.process.pid, signal.SIGUSR1)  # somebody's slip: nothing ends
        os.kill(running.process.pid, signal.Signals[name])
        assert running.process.wait(20.0) == 0
    record = read_session(tmp_path / "state" / "sessions" / session)
    assert (record.meta["outcome"], record.meta["reason"]) == ("stopped", f"asked for by {name}")
    assert list(record.trajectory["why"])[-1] == "retract"
