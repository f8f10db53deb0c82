"""The daemon without sockets or worker: requests and the worker's words go in by hand."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from legato.control.memory import Memory
from legato.daemon.conductor import Conductor
from legato.daemon.desk import Desk
from legato.daemon.events import Events
from legato.daemon.journal import Journal
from legato.daemon.messages import (
    DevicesKnown,
    FaultReport,
    JobEnded,
    Message,
    StateWanted,
    TaskEnded,
    View,
)
from legato.daemon.orders import DoJob, DoReference, DoReset, Orders, Task
from legato.daemon.sessions import Sessions
from legato.daemon.standing import Setting, Standing
from legato.hal.faults import Cause
from legato.records.store import Store
from tests.unit.daemon.bench import Silent, home_steps, settings

ZERO = (0, 0, 0, 0, 0, 0)
ARM = {
    "connected": True,
    "referenced": True,
    "xyz_mm": [127.0, 0.0, 150.0],
    "pitch_deg": -90.0,
    "roll_deg": 0.0,
    "contact": False,
}
GOOD = View(arm=ARM, camera_connected=True, memory=Memory(home_steps(), ZERO))


@dataclass
class House:
    """Conductor and desk over a real store; time is what the tests say it is."""

    folder: Path
    fault: dict[str, Any] | None = None
    min_free_mb: float = 0.0
    now: float = 100.0
    wall: Callable[[], datetime] = lambda: datetime.now(UTC)
    replies: list[tuple[bytes, dict[str, Any]]] = field(default_factory=list)
    events: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    calls: int = 0
    on_send: Callable[[list[bytes]], None] = lambda _: None
    on_publish: Callable[[str, bytes], None] = lambda _, __: None

    def __post_init__(self) -> None:
        """Build the parts as `serve` does."""
        self.orders, self.log = Orders(), Silent()
        self.store = Store(self.folder)
        self.published = Events("boot", lambda: self.now, self._publish)
        setting = Setting(settings(), "boot", lambda: self.now, self.min_free_mb, {"config": {}})
        self.sessions = Sessions(self.store, self.store.sessions(), self.wall)
        journal = Journal(self.sessions, self.published, self.store, setting.clock, self.log)
        standing = Standing(
            setting, self.sessions, journal, self.log, now=self.now, fault=self.fault
        )
        self.conductor = Conductor(setting, standing, journal, self.orders, self.store, self.log)
        self.desk = Desk(self.conductor, self.published, settings(), self._send, self.log)

    def known(self, view: View = GOOD) -> "House":
        """Let the devices be known."""
        self.hear(DevicesKnown(view, {"legato": "test"}))
        return self

    def ask(self, method: str, **params: Any) -> dict[str, Any] | None:
        """Send a request; return its answer if it has one already."""
        self.calls += 1
        call = {"jsonrpc": "2.0", "id": self.calls, "method": method, "params": params}
        self.desk.receive([b"client", json.dumps(call).encode()], self.now)
        self.desk.settle(self.now)
        return self.answer(self.calls)

    def answer(self, call: int) -> dict[str, Any] | None:
        """Return the answer to a call, None where there is none yet."""
        return next((body for _, body in self.replies if body.get("id") == call), None)

    def result(self, method: str, **params: Any) -> dict[str, Any]:
        """Return the result of a request that succeeds at once."""
        answer = self.ask(method, **params)
        assert answer is not None, f"{method} has no answer yet"
        assert "result" in answer, answer
        found: dict[str, Any] = answer["result"]
        return found

    def error(self, method: str, **params: Any) -> tuple[int, str, str]:
        """Return code, name and reason of a request that is refused at once."""
        answer = self.ask(method, **params)
        assert answer is not None, f"{method} has no answer yet"
        error = answer["error"]
        assert error["data"]["state"] == self.conductor.state
        return error["code"], error["message"], error["data"]["reason"]

    def hear(self, message: Message) -> None:
        """Let the worker say something."""
        self.conductor.receive(message)
        self.desk.settle(self.now)

    def pass_time(self, seconds: float) -> None:
        """Let the wall's time pass, with one look at it at the end."""
        self.now += seconds
        self.conductor.tick(self.now)
        self.desk.settle(self.now)

    def task(self) -> Task | None:
        """Return what the worker is given next."""
        return self.orders.next_task(0.0)

    def begin(self, job: str = "run") -> str:
        """Begin a job and let the worker take it; return its session."""
        session: str = self.result(job)["session"]
        task = self.task()
        assert isinstance(task, DoJob)
        assert (task.session, task.job) == (session, job)
        return session

    def want(self, session: str, state: str) -> bool:
        """Let the running procedure want a state; say whether it was granted."""
        self.hear(StateWanted(session, state))
        return self.orders.entered()

    def end(
        self, session: str, outcome: str | None = "done", fault: FaultReport | None = None
    ) -> None:
        """Let the worker end a job."""
        reason = fault.text if fault else ("because" if outcome == "refused" else None)
        cause = fault.cause if fault else None
        self.hear(JobEnded(session, outcome, reason, cause, fault, GOOD))

    def end_task(self, problem: tuple[str, str] | None = None, view: View = GOOD) -> None:
        """Let the worker end the reset or the referencing that it was given."""
        task = self.task()
        assert isinstance(task, DoReset | DoReference)
        self.hear(TaskEnded(task.token, view, problem))

    def states(self) -> list[str]:
        """Return the states as they were published."""
        return [event["state"] for topic, event in self.events if topic == "state"]

    def of(self, topic: str) -> list[dict[str, Any]]:
        """Return the events of a topic."""
        return [event for t, event in self.events if t == topic]

    def close(self) -> None:
        """Let go of an open record."""
        if self.sessions.current is not None and self.sessions.current.writer is not None:
            self.sessions.current.writer.close()

    def _send(self, frames: list[bytes]) -> None:
        self.replies.append((frames[0], json.loads(frames[-1])))
        self.on_send(frames)

    def _publish(self, topic: str, body: bytes) -> None:
        self.events.append((topic, json.loads(body)))
        self.on_publish(topic, body)


CAMERA_LOST = FaultReport(Cause.CAMERA_LOST, "no picture", "plug it in", {"picture": None})


def session_json(house: House, session: str) -> dict[str, Any]:
    """Return a record's session.json."""
    path = house.store.folder / session / "session.json"
    found: dict[str, Any] = json.loads(path.read_text())
    return found


Maker = Callable[..., House]
