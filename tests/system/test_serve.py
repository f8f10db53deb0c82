"""The daemon as a process: a plain JSON-RPC client runs, pauses, stops and kills it."""

import itertools
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zmq

from legato.config.load import load
from legato.config.toml import dumps
from legato.records.chain import verify_chain

RUN = ["capture", "calibrate", "verify", "move_home", "massage_7", "massage_67", "massage_127",
       "massage_187", "move_home", "idle"]  # fmt: skip
ANY = "tcp://127.0.0.1:*"


def configuration(folder: Path, **sim: Any) -> Path:
    """Write the shipped simulated cell's configuration with free ports and its own state folder."""
    data: dict[str, Any] = {name: dict(table) for name, table in load().data.items()}
    data["server"] = {"requests": ANY, "events": ANY, "stop": ANY}
    data["records"] |= {"state_dir": str(folder / "state"), "min_free_mb": 1}
    data["sim"] |= sim
    path = folder / "cell.toml"
    path.write_text(dumps(data, "Made by a test."), encoding="utf-8")
    return path


class Daemon:
    """`legato serve` with a REQ and a SUB socket that only know JSON-RPC and JSON."""

    def __init__(self, config: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "legato", "serve", "--config", str(config)],
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            text=True,
        )
        self.lines: list[dict[str, Any]] = []
        self._context = zmq.Context()
        self._ids = itertools.count(1)
        self._ready = threading.Event()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()
        self._ready.wait(30.0)
        ready = self.logged("ready")
        assert ready, f"not ready: {self.lines}"
        self.requests = str(ready[0]["requests"])
        self._req = self.connected(zmq.REQ, self.requests)
        self._sub = self._context.socket(zmq.SUB)
        self._sub.linger = 0
        self._sub.subscribe(b"")
        self._sub.connect(str(ready[0]["events"]))
        self.heard: list[tuple[str, dict[str, Any]]] = []
        self.event("state")  # the snapshot: the subscription stands

    def connected(self, kind: int, endpoint: str) -> "zmq.Socket[bytes]":
        """Return a plain client's socket."""
        socket = self._context.socket(kind)
        socket.linger = 0
        socket.connect(endpoint)
        return socket

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """Send a request and return the whole answer."""
        call = {"jsonrpc": "2.0", "id": next(self._ids), "method": method, "params": params}
        self._req.send_json(call)
        assert self._req.poll(60_000), f"no answer to {method}"
        answer: dict[str, Any] = json.loads(self._req.recv())
        assert answer["id"] == call["id"]
        return answer

    def do(self, method: str, **params: Any) -> dict[str, Any]:
        """Return the result of a request that succeeds."""
        answer = self.ask(method, **params)
        assert "result" in answer, answer
        found: dict[str, Any] = answer["result"]
        return found

    def error(self, method: str, **params: Any) -> dict[str, Any]:
        """Return the error of a request that is refused."""
        found: dict[str, Any] = self.ask(method, **params)["error"]
        return found

    def wait(self, session: str) -> str:
        """Return a session's outcome."""
        return str(self.do("wait", session=session, timeout_s=60)["outcome"])

    def event(self, topic: str, **wanted: Any) -> dict[str, Any]:
        """Return the next event of a topic that has these members."""
        while True:
            assert self._sub.poll(30_000), f"no {topic} {wanted}; heard {self.heard[-5:]}"
            name, body = self._sub.recv_multipart()
            event: dict[str, Any] = json.loads(body)
            self.heard.append((name.decode(), event))
            if name.decode() == topic and wanted.items() <= event.items():
                return event

    def states(self) -> list[str]:
        """Return the states heard so far."""
        return [event["state"] for topic, event in self.heard if topic == "state"]

    def logged(self, event: str) -> list[dict[str, Any]]:
        """Return the log's lines of an event."""
        return [line for line in self.lines if line.get("event") == event]

    def to_idle(self) -> None:
        """Bring the cell to idle."""
        if self.do("status")["state"] == "fault":
            self.do("reset")
        assert self.do("status")["state"] == "idle"

    def close(self) -> None:
        """End the process and let go of the sockets."""
        if self.process.poll() is None:
            self.process.terminate()
        try:
            self.process.wait(20.0)
        finally:
            self.process.kill()
            self.process.wait()
            self._reader.join()
            assert self.process.stderr is not None
            self.process.stderr.close()
            self._context.destroy(linger=0)

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            try:
                self.lines.append(json.loads(line))
            except ValueError:
                self.lines.append({"text": line})
            if self.lines[-1].get("event") == "ready":
                self._ready.set()
        self._ready.set()


@contextmanager
def daemon(config: Path) -> Iterator[Daemon]:
    """Give a running daemon; it ends with this."""
    running = Daemon(config)
    try:
        yield running
    finally:
        running.close()


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
    ready_to_massage(shared)
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
    ready_to_massage(shared)
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


def test_sigterm_retracts_and_ends_cleanly(tmp_path: Path) -> None:
    """Told to end in a pass, the daemon stops the job first and exits with 0."""
    config = configuration(tmp_path, seed=1, time_scale=20.0)
    with daemon(config) as running:
        session = running.do("run")["session"]
        running.event("state", state="massage_7")
        os.kill(running.process.pid, signal.SIGTERM)
        assert running.process.wait(20.0) == 0
    meta = json.loads((tmp_path / "state" / "sessions" / session / "session.json").read_text())
    assert meta["outcome"] == "stopped"


def ready_to_massage(cell: Daemon) -> None:
    """See that the cell is idle, referenced, and has a verified calibration."""
    cell.to_idle()
    status = cell.do("status")
    if not (status["calibration"] or {}).get("valid"):
        for job in ("capture", "calibrate", "verify"):
            assert cell.wait(cell.do(job)["session"]) == "done"
    assert status["arm"]["referenced"]
    cell.heard.clear()
