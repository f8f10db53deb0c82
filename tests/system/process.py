"""`legato serve` as a process, and a plain client of it that only knows JSON-RPC and JSON."""

import itertools
import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import zmq

from legato.config.load import load
from legato.config.toml import dumps

ANY = "tcp://127.0.0.1:*"


def configuration(folder: Path, server: dict[str, Any] | None = None, **sim: Any) -> Path:
    """Write the shipped simulated cell's configuration with its own lines and state folder.

    The lines have free ports where `server` says nothing else.
    """
    data: dict[str, Any] = {name: dict(table) for name, table in load().data.items()}
    data["server"] = {"requests": ANY, "events": ANY, "stop": ANY} | (server or {})
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

    def ready_to_massage(self) -> None:
        """See that the cell is idle, referenced, and has a verified calibration."""
        self.to_idle()
        status = self.do("status")
        if not (status["calibration"] or {}).get("valid"):
            for job in ("capture", "calibrate", "verify"):
                assert self.wait(self.do(job)["session"]) == "done"
        assert status["arm"]["referenced"]
        self.heard.clear()

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
