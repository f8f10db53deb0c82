"""A client of one of the daemon's lines that keeps what it is owed."""

import json
import time
from collections.abc import Callable, Mapping
from math import ceil
from typing import Any

import zmq

from legato.daemon.keys import Keys
from tests.system.emulated import HOME


class Line:
    """One client of one socket, which may send much and read it later."""

    def __init__(self, endpoint: str, keys: Keys | None = None) -> None:
        self.endpoint = endpoint
        self.pending: dict[int, tuple[str, float]] = {}
        self.answers: dict[int, dict[str, Any]] = {}
        self.unknown: list[Any] = []
        """Answers to nothing that was asked, and answers that came twice."""
        self.slowest = ("", 0.0)
        self._keys = keys
        self._last = 0
        self.context = zmq.Context()
        self.socket = self._made()

    def _made(self) -> "zmq.Socket[bytes]":
        made = self.context.socket(zmq.DEALER)
        made.linger = 0
        made.setsockopt(zmq.RECONNECT_IVL, 10)
        made.setsockopt(zmq.RECONNECT_IVL_MAX, 100)
        if self._keys is not None:
            made.setsockopt(zmq.CURVE_PUBLICKEY, self._keys.public)
            made.setsockopt(zmq.CURVE_SECRETKEY, self._keys.secret)
            made.setsockopt(zmq.CURVE_SERVERKEY, self._keys.server)
        made.connect(self.endpoint)
        return made

    def again(self) -> None:
        """Forget what was asked, and connect anew: the daemon was another."""
        self.socket.close(linger=0)
        self.pending.clear()
        self.socket = self._made()

    def send(self, method: str, /, **params: Any) -> int:
        """Send a request and return its number."""
        self._last += 1
        self.pending[self._last] = method, time.monotonic()
        call = {"jsonrpc": "2.0", "id": self._last, "method": method, "params": params}
        self.socket.send(json.dumps(call).encode())
        return self._last

    def take(self, timeout_s: float) -> bool:
        """Take in the next answer; say whether one came."""
        if not self.socket.poll(ceil(max(timeout_s, 0.0) * 1000.0)):
            return False
        answer = json.loads(self.socket.recv_multipart()[-1])
        asked = self.pending.pop(answer.get("id"), None)
        if asked is None:
            if answer.get("id") is not None:
                self.unknown.append(answer)
            return True
        late = time.monotonic() - asked[1]
        if asked[0] in ("status", "ping") and late > self.slowest[1]:
            self.slowest = asked[0], late
        self.answers[answer["id"]] = answer
        return True

    def answer(self, number: int, timeout_s: float = 25.0) -> dict[str, Any]:
        """Return the answer to a request. Raises TimeoutError."""
        until = time.monotonic() + timeout_s
        while number not in self.answers:
            if not self.take(until - time.monotonic()):
                raise TimeoutError(f"no answer to {self.pending.get(number)} in {timeout_s:g} s")
        return self.answers.pop(number)

    def ask(self, method: str, /, **params: Any) -> dict[str, Any]:
        """Return the whole answer to a request."""
        return self.answer(self.send(method, **params))

    def do(self, method: str, /, **params: Any) -> dict[str, Any]:
        """Return the result of a request that succeeds."""
        answer = self.ask(method, **params)
        assert "result" in answer, (method, params, answer)
        found: dict[str, Any] = answer["result"]
        return found

    def outcome(self, session: str, within_s: float = 60.0) -> str:
        """Return a session's outcome."""
        until = time.monotonic() + within_s
        while time.monotonic() < until:
            told = self.do("wait", session=session, timeout_s=2.0)
            if told["outcome"] is not None:
                return str(told["outcome"])
        raise TimeoutError(f"{session} has no outcome after {within_s:g} s")

    def drain(self, timeout_s: float) -> list[str]:
        """Take in all that is owed; return the methods that were not answered."""
        until = time.monotonic() + timeout_s
        while self.pending and self.take(until - time.monotonic()):
            pass
        return [method for method, _ in self.pending.values()]

    def close(self) -> None:
        """Let go of the socket."""
        self.context.destroy(linger=0)


def answering(endpoint: str, keys: Keys | None = None, give_up_s: float = 30.0) -> float:
    """Return how long it takes until a daemon answers a client that was there before it."""
    began = time.monotonic()
    line = Line(endpoint, keys)
    try:
        line.answer(line.send("ping"), give_up_s)
    finally:
        line.close()
    return time.monotonic() - began


def brought_to_idle(line: Line, within_s: float = 30.0) -> dict[str, Any]:
    """Reset until the cell is idle, as a person would; return its status."""
    until = time.monotonic() + within_s
    while time.monotonic() < until:
        status = line.do("status")
        if status["state"] == "idle" and not (status["campaign"] or {}).get("underway"):
            return status
        if status["state"] == "fault":
            line.ask("reset")
        else:
            line.ask("stop")
            time.sleep(0.02)
    raise AssertionError(f"the cell does not become idle: {line.do('status')}")


def ready_to_massage(line: Line, tip: Callable[[], Mapping[str, Any]] = HOME.copy) -> None:
    """See that the arm is referenced and the leg found; `tip` tells where it truly stands."""
    for _ in range(20):
        status = brought_to_idle(line)
        if not status["arm"]["referenced"]:
            line.ask("reference", **tip())
        if (status["calibration"] or {}).get("valid"):
            return
        for job in ("capture", "calibrate", "verify"):
            begun = line.ask(job)
            if "result" not in begun:
                time.sleep(0.1)  # somebody has a lease, or a device is not back yet
                break
            if line.outcome(begun["result"]["session"]) != "done":
                break
    raise AssertionError(f"the cell does not become ready: {line.do('status')}")
