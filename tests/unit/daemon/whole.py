"""The whole daemon in one process on fakes: loop, worker and stop line, each in its own thread."""

import itertools
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import zmq

from legato.control.effects import Effect, Enter, Hold, PauseRequested, StopRequested
from legato.control.memory import Memory
from legato.control.settings import CellSettings
from legato.daemon.cell import Cell, WallClock
from legato.daemon.conductor import Conductor
from legato.daemon.desk import Desk
from legato.daemon.events import Events
from legato.daemon.journal import Journal
from legato.daemon.loop import Loop
from legato.daemon.mailbox import Mailbox
from legato.daemon.orders import Orders
from legato.daemon.sessions import Sessions
from legato.daemon.sockets import Sockets
from legato.daemon.standing import Setting, Standing
from legato.daemon.stopline import StopLine
from legato.daemon.worker import Worker
from legato.records.store import Store
from tests.unit.daemon.bench import ZERO, Arm, Camera, Silent, home_steps, settings, turn

ANY = "tcp://127.0.0.1:*"
Work = Iterator[Effect]


class Whole:
    """A daemon whose jobs turn the base a half-step at a time, until told otherwise.

    `before_step` is called before each motion reaches the arm, `before_publish` by the loop
    before each event leaves: what blocks there blocks the driver, or the loop.
    """

    def __init__(self, folder: Path) -> None:
        self.before_step: Callable[[], None] = lambda: None
        self.before_publish: Callable[[str], None] = lambda _: None
        self.arm = Arm(on_step=lambda: self.before_step())
        self.log = Silent()
        self.store = Store(folder)
        self.orders, self.mailbox = Orders(), Mailbox()
        self.sockets = Sockets(ANY, ANY, ANY)
        cell = Cell(self.arm, Camera(), WallClock())
        events = Events("boot", time.monotonic, self._publish)
        setting = Setting(settings(), "boot", time.monotonic, 0.0, {"config": {}})
        sessions = Sessions(self.store, self.store.sessions())
        last = home_steps(), ZERO
        journal = Journal(sessions, events, self.store, setting.clock, self.log, last)
        now = time.monotonic()
        standing = Standing(setting, sessions, journal, self.log, now=now, fault=None)
        self.conductor = Conductor(setting, standing, journal, self.orders, self.store, self.log)
        self.stopline = StopLine(
            self.sockets.stop,
            self.sockets.receive,
            self.orders.gate,
            (self.orders.wake, self.mailbox.ring),
            boot="boot",
            state=lambda: self.conductor.state,
            post=self.mailbox.offer,
        )
        desk = Desk(
            self.conductor, events, settings(), self.sockets.send, self.log, self.stopline.told
        )
        self.worker = Worker(
            lambda: cell,
            settings(),
            self.orders,
            self.mailbox.put,
            self.log,
            last=last,
            procedures=work,
            look_s=60.0,
        )
        ready = threading.Event()
        self._loop = Loop(self.sockets, self.mailbox, self.conductor, desk, events, ready.set)
        self._thread = threading.Thread(target=self._loop.run)
        self._context = zmq.Context()
        self._ids = itertools.count(1)
        self._lines = {
            name: self._connected(self.sockets.endpoints[name]) for name in ("requests", "stop")
        }
        for part in (self.stopline, self.worker, self._thread):
            part.start()
        assert ready.wait(20.0)

    def send(self, method: str, *, line: str = "requests", **params: Any) -> int:
        """Send a request and return its id."""
        number = next(self._ids)
        call = {"jsonrpc": "2.0", "id": number, "method": method, "params": params}
        self._lines[line].send_json(call)
        return number

    def answer(self, call: int, *, line: str = "requests", within_s: float = 20.0) -> Any:
        """Return the whole answer to the last call on a line; None where none comes."""
        if not self._lines[line].poll(round(within_s * 1000.0)):
            return None
        found = json.loads(self._lines[line].recv())
        assert found["id"] == call
        return found

    def do(self, method: str, *, line: str = "requests", **params: Any) -> dict[str, Any]:
        """Return the result of a request that succeeds."""
        answer = self.answer(self.send(method, line=line, **params), line=line)
        assert answer is not None, f"no answer to {method}"
        assert "result" in answer, answer
        found: dict[str, Any] = answer["result"]
        return found

    def error(self, method: str, *, line: str = "requests", **params: Any) -> dict[str, Any]:
        """Return the error of a request that is refused."""
        answer = self.answer(self.send(method, line=line, **params), line=line)
        assert answer is not None, f"no answer to {method}"
        found: dict[str, Any] = answer["error"]
        return found

    def until(self, holds: Callable[[], bool]) -> None:
        """Wait until something is so."""
        for _ in range(4000):
            if holds():
                return
            time.sleep(0.005)
        raise AssertionError("it has not come to be")

    def until_moving(self) -> None:
        """Wait until motions go out."""
        count = len(self.arm.moves)
        self.until(lambda: len(self.arm.moves) > count + 2)

    def close(self) -> None:
        """End all threads and let go of everything."""
        self.before_step, self.before_publish = (lambda: None), (lambda _: None)
        self.do("shutdown")
        self._thread.join(30.0)
        assert not self._thread.is_alive()
        assert self.worker.join(10.0)
        for line in self._lines.values():
            line.close(linger=0)
        self._context.term()
        self.stopline.end()
        self.sockets.close()
        self.mailbox.close()

    def _connected(self, endpoint: str) -> "zmq.Socket[bytes]":
        socket = self._context.socket(zmq.DEALER)
        socket.linger = 0
        socket.connect(endpoint)
        return socket

    def _publish(self, topic: str, body: bytes) -> None:
        self.before_publish(topic)
        self.sockets.publish(topic, body)


@contextmanager
def whole(folder: Path) -> Iterator[Whole]:
    """Give a running daemon; it ends with this."""
    made = Whole(folder)
    try:
        yield made
    finally:
        made.close()


def work(job: str, given: CellSettings, memory: Memory, now: float) -> Any:
    """Turn the base to and fro until stopped; hold when paused; the retract is one motion back."""
    del job, given, now
    yield Enter("move_home")
    way = itertools.cycle((1, 1, 1, -1, -1, -1))
    try:
        while True:
            try:
                yield from _step(memory, next(way))
            except PauseRequested:
                yield Enter("paused")
                yield Hold()
                yield Enter("move_home")
    except StopRequested:
        yield Enter("stopping")
        yield from _step(memory, 7)
        return "stopped"


def _step(memory: Memory, by: int) -> Any:
    steps = memory.steps()
    assert steps is not None
    memory.registers = (yield turn(steps, by)).registers
