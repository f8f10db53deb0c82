"""Requests: each message alone is parsed, admitted by the total table, carried out and answered.

What cannot be answered at once waits here without blocking anybody. Junk is answered and counted.
"""

import math
import traceback
from collections.abc import Callable, Mapping, Sequence
from typing import Any, assert_never

from legato.control.settings import CellSettings
from legato.control.table import JOBS, admit
from legato.daemon.conductor import Conductor
from legato.daemon.events import Events
from legato.daemon.log import Log
from legato.daemon.sessions import Session as KnownSession
from legato.daemon.status import describe
from legato.daemon.waiters import DEVICES, Waiter, Waiters, What
from legato.geometry.arm import Unreachable, reach
from legato.geometry.motion import ToolPose
from legato.wire.jsonrpc import Call, Failure, Malformed, answer, decode_params, receive, refuse
from legato.wire.requests import (
    Describe,
    Estop,
    EventsSince,
    Job,
    Pause,
    Ping,
    Reference,
    Request,
    Reset,
    Resume,
    Session,
    Sessions,
    Shutdown,
    Status,
    Stop,
    Wait,
)

TASK_S = 20.0  # how long reset and reference may take, and how long a job waits for the devices
NEED_DEVICES = (*JOBS, "reference", "reset")

Result = Mapping[str, Any]
Send = Callable[[list[bytes]], None]


class Desk:
    """Answers requests through `send`, in frames; the loop's thread alone uses it."""

    def __init__(
        self, conductor: Conductor, events: Events, settings: CellSettings, send: Send, log: Log
    ) -> None:
        self.junk = 0
        self._conductor = conductor
        self._events = events
        self._settings = settings
        self._send = send
        self._log = log
        self._waiters = Waiters()

    def receive(self, frames: Sequence[bytes], now: float) -> None:
        """Take in one message; whatever it is, nothing is raised."""
        message = receive(frames)
        if isinstance(message, Malformed):
            self.junk += 1
            self._log.debug("junk", reason=message.failure.reason, count=self.junk)
            frames = refuse(message.route, message.id, message.failure, self._conductor.state)
            self._send(frames)
        else:
            self._answer(message, now)

    def settle(self, now: float) -> None:
        """Answer those whose wait has ended or whose time is up."""
        settled, self._conductor.settled = self._conductor.settled, []
        for what, result in settled:
            for call in self._waiters.take(what):
                if what == DEVICES:
                    self._answer(call, now)
                elif isinstance(result, Failure):
                    self._refuse(call, result)
                else:
                    self._reply(call, result or self._wait_told(str(what[1])))
        for waiter in self._waiters.take_due(now):
            self._out_of_time(waiter)

    def next_due(self) -> float:
        """Return when `settle` is due next."""
        return self._waiters.next_due()

    def close(self) -> None:
        """Answer all that still wait: the daemon ends."""
        for waiter in self._waiters.take_all():
            if _is_session(waiter.what):
                self._reply(waiter.call, self._wait_told(str(waiter.what[1])))
            else:
                self._refuse(waiter.call, Failure("unavailable", "the daemon is shutting down"))

    def _answer(self, call: Call, now: float) -> None:
        """Carry out one request and answer it, now or later."""
        try:
            result = self._carried_out(call, now)
        except Failure as failure:
            self._refuse(call, failure)
        except Exception as error:  # noqa: BLE001  # a bug in one request must not reach the next
            self._log.error("bug", method=call.method, traceback=traceback.format_exc())
            hint = "report it with the daemon's log"
            self._refuse(call, Failure("internal_error", f"{type(error).__name__}: {error}", hint))
        else:
            if result is not None:
                self._reply(call, result)

    def _carried_out(self, call: Call, now: float) -> Result | None:
        """Return the result of a request, None where it is answered later; raises Failure."""
        request = decode_params(call)
        if isinstance(request, Job) and request.key is not None:
            known = self._conductor.standing.sessions.with_key(request.key)
            if known is not None:
                return self._repeated(call.method, known)
        if call.method in NEED_DEVICES and not self._conductor.devices_known:
            return self._later(call, DEVICES, now + TASK_S)
        no = admit(call.method, self._conductor.state)
        if no is not None:
            raise Failure(no.code, no.reason, no.hint)
        return self._done(call, request, now)

    def _done(self, call: Call, request: Request, now: float) -> Result | None:
        """Carry out an admitted request."""
        conductor = self._conductor
        match request:
            case Ping():
                return {"boot": self._events.boot, "state": conductor.state}
            case Status():
                return conductor.standing.status()
            case Describe():
                return describe(self._settings.stations)
            case Wait(session=session, timeout_s=timeout):
                told = self._wait_told(session)
                if told["outcome"] is not None or timeout == 0:
                    return told
                return self._later(call, ("session", session), now + timeout)
            case Sessions(limit=limit):
                return {"sessions": conductor.standing.sessions.latest(limit)}
            case Session(session=session):
                return self._found(session).told()
            case EventsSince(boot=boot, seq=seq, limit=limit):
                return self._events.since(boot, seq, limit)
            case Job(key=key):
                started = conductor.start(call.method, key)
                return {"session": started.id, "state": conductor.state}
            case Pause():
                conductor.pause()
            case Resume():
                conductor.resume()
            case Stop():
                conductor.stop()
            case Estop():
                conductor.estop()
            case Reset():
                return self._later(call, ("task", conductor.reset()), now + TASK_S)
            case Reference():
                token = conductor.reference(self._pose(request))
                return self._later(call, ("task", token), now + TASK_S)
            case Shutdown():
                conductor.shutdown()
            case _:
                assert_never(request)
        current = conductor.standing.sessions.current
        return {"session": current.id if current else None, "state": conductor.state}

    def _later(self, call: Call, what: What, due: float) -> Result | None:
        """Let a request wait."""
        if self._waiters.full:
            raise Failure("unavailable", "too many requests wait", "ask again later")
        self._waiters.add(call, what, due)
        return None

    def _out_of_time(self, waiter: Waiter) -> None:
        """Answer a request whose time is up."""
        what = waiter.what
        if _is_session(what):
            self._reply(waiter.call, self._wait_told(str(what[1])))
            return
        if what != DEVICES:
            self._conductor.give_up(int(what[1]))
        hint = "see status; try again when the devices answer"
        self._refuse(waiter.call, Failure("unavailable", "the devices are slow to answer", hint))

    def _repeated(self, method: str, known: KnownSession) -> Result:
        """Answer a job that was asked for before: nothing starts."""
        if known.job != method:
            reason = f"this key has started {known.job}, not {method}"
            raise Failure("invalid_params", reason, "use a new key for each job")
        return {"session": known.id, "state": self._conductor.state}

    def _wait_told(self, session: str) -> dict[str, Any]:
        known = self._found(session)
        return {
            "session": known.id,
            "state": self._conductor.state,
            "outcome": known.outcome,
            "reason": known.reason,
        }

    def _found(self, session: str) -> KnownSession:
        known = self._conductor.standing.sessions.find(session)
        if known is None:
            raise Failure("invalid_params", f"there is no session {session!r}", "see sessions")
        return known

    def _pose(self, request: Reference) -> ToolPose:
        """Return the pose that the operator tells, the configured start pose where nothing is."""
        start = self._settings.start
        x, y, z = request.xyz_mm if request.xyz_mm is not None else (start.x, start.y, start.z)
        pitch = start.pitch if request.pitch_deg is None else math.radians(request.pitch_deg)
        roll = start.roll if request.roll_deg is None else math.radians(request.roll_deg)
        try:
            reach(self._settings.arm, (x, y, z), pitch, roll)
        except Unreachable as error:
            hint = "give the pose at which the arm truly stands"
            raise Failure("invalid_params", f"the arm cannot stand there: {error}", hint) from error
        return ToolPose(x, y, z, pitch, roll, start.grip)

    def _reply(self, call: Call, result: Result) -> None:
        told = self._log.info if call.method in NEED_DEVICES else self._log.debug
        told("request", method=call.method, ok=True, state=self._conductor.state)
        if not call.notification:
            self._send(answer(call.route, call.id, result))

    def _refuse(self, call: Call, failure: Failure) -> None:
        state = self._conductor.state
        self._log.info(
            "request", method=call.method[:64], ok=False, error=failure.name,
            reason=failure.reason, state=state,
        )  # fmt: skip
        if not call.notification:
            self._send(refuse(call.route, call.id, failure, state))


def _is_session(what: What) -> bool:
    return what[0] == "session"
