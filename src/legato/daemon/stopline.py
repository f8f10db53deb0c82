"""The stop line: a thread that owns its socket and does nothing but close the gate, and say so.

No queue, lease, lock or disk stands between a stop and the gate. An answer says confirmed only
when the motion that was on its way has ended and the driver has said so.
"""

import threading
import traceback
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from math import ceil
from typing import Any

import zmq

from legato.control.states import FAULT, IDLE, STOPPING
from legato.control.table import authorise
from legato.daemon.gate import Asked, Gate, Moment, present
from legato.daemon.mailbox import Bell
from legato.daemon.messages import Message, StopAnswered, StopLineBug
from legato.daemon.tally import Tally
from legato.daemon.who import Who
from legato.wire.jsonrpc import Call, Failure, Malformed, answer, decode_stop, receive, refuse
from legato.wire.requests import Ping, StopNow

BATCH = 64
LOOP_S = 0.1  # how long the loop may take to refuse the jobs that came before a stop
MOST = 256  # stops that may wait for their motion's end; more are answered as it stands

Arrived = tuple[list[bytes], Who]


@dataclass
class _Given:
    """One stop that was given: to whom it is answered, and until when its motion is waited for."""

    asked: Asked
    call: Call
    commanded: Moment
    motion: int | None
    due: float
    loop_due: float
    state: str


class StopLine:
    """Answers ping, stop and estop in every state of the daemon and of its devices.

    `receive` takes in the next message without waiting, None where there is none; `wake` lets
    those who wait look at the gate; `state` is the loop's; `post` tells the loop afterwards.
    """

    def __init__(
        self,
        socket: "zmq.Socket[bytes]",
        receive: Callable[["zmq.Socket[bytes]"], Arrived | None],
        gate: Gate,
        wake: Iterable[Callable[[], None]],
        *,
        boot: str,
        state: Callable[[], str],
        post: Callable[[Message], None],
        moment: Callable[[], Moment] = present,
    ) -> None:
        self.commanded = Tally()
        self.confirmed = Tally()
        self.junk = 0
        self._socket = socket
        self._receive = receive
        self._gate = gate
        self._wake = tuple(wake)
        self._boot = boot
        self._state = state
        self._post = post
        self._moment = moment
        self._given: list[_Given] = []
        self._late: _Given | None = None
        self._last: dict[str, Any] | None = None
        self._ended = False
        self._bell = Bell()
        gate.ring = self._bell.ring
        self._thread = threading.Thread(target=self._run, name="stop", daemon=True)

    def start(self) -> None:
        """Begin to listen."""
        self._thread.start()

    def end(self) -> None:
        """End the thread; who still waits is answered as it stands."""
        self._ended = True
        self._bell.ring()
        if self._thread.ident is not None:
            self._thread.join()
        self._settle(float("inf"))
        self._bell.close()

    def told(self) -> dict[str, Any]:
        """Return the latencies for status: from received to commanded, and to confirmed."""
        return {"commanded": self.commanded.told(), "confirmed": self.confirmed.told()}

    def turn(self) -> None:
        """Wait for what comes next, and handle all that has come."""
        self._wait()
        self._bell.silence()
        for _ in range(BATCH):
            arrived = self._receive(self._socket)
            if arrived is None:
                break
            self._handle(arrived, self._moment())
        self._settle(self._moment().t)

    def _run(self) -> None:
        while not self._ended:
            try:
                self.turn()
            except Exception:  # noqa: BLE001  # whatever it was, the next stop must be heard
                self._post(StopLineBug(traceback.format_exc()))

    def _wait(self) -> None:
        due = min((_look_at(g) for g in self._given), default=None)
        wait = None if due is None else ceil(max(due - self._moment().t, 0.0) * 1000.0)
        poller = zmq.Poller()
        poller.register(self._socket, zmq.POLLIN)
        poller.register(self._bell.fileno(), zmq.POLLIN)
        poller.poll(wait)

    def _handle(self, arrived: Arrived, received: Moment) -> None:
        frames, who = arrived
        message = receive(frames)
        if isinstance(message, Malformed):
            self.junk += 1
            self._send(refuse(message.route, message.id, message.failure, self._state()))
            return
        try:
            self._carry_out(message, who, received)
        except Failure as failure:
            if not message.notification:
                self._send(refuse(message.route, message.id, failure, self._state()))

    def _carry_out(self, call: Call, who: Who, received: Moment) -> None:
        request = decode_stop(call)
        no = authorise(call.method, who.role)
        if no is not None:
            raise Failure(no.code, no.reason, no.hint)
        match request:
            case Ping():
                told = {"boot": self._boot, "state": self._state(), "now": self._moment().t}
                self._answer(call, told | {"closed": self._gate.closed, "last": self._last})
            case StopNow(timeout_s=timeout):
                self._give(call, who, received, timeout)

    def _give(self, call: Call, who: Who, received: Moment, timeout: float) -> None:
        """Close the gate or ask for a stop; only then think of anything else."""
        asked = self._gate.ask(who.name, received, estop=call.method == "estop")
        commanded = self._moment()
        motion = self._gate.on_its_way()
        for wake in self._wake:
            wake()
        self.commanded.add(commanded.t - received.t)
        state = FAULT if self._gate.closed else _then(self._state())
        due = received.t + (timeout if len(self._given) < MOST else 0.0)
        # Who has this answer may begin a job at once: it must not be taken for one sent before.
        loop_due = min(due, received.t + LOOP_S) if state == IDLE else received.t
        self._given.append(_Given(asked, call, commanded, motion, due, loop_due, state))

    def _settle(self, now: float) -> None:
        """Answer those whose motion has ended, and those whose time is up."""
        waiting, self._given = self._given, []
        for given in waiting:
            if self._has_ended(given, now):
                self._answer(given.call, self._last)
            elif now >= given.due:
                self._tell(given, None, "the motion on its way has not ended yet")
                self._answer(given.call, self._last)
                self._late = given
            else:
                self._given.append(given)
        if self._late is not None and self._has_ended(self._late, now):
            self._late = None

    def _has_ended(self, given: _Given, now: float) -> bool:
        """Say whether a stop's motion is over, and tell how that was."""
        if given.motion is None:
            if now < given.loop_due and not self._gate.drained(given.asked):
                return False
            self._tell(given, given.commanded, None)
            return True
        end = self._gate.end_of(given.motion)
        if end is None:
            return False
        self._tell(given, end.at if end.problem is None else None, end.problem)
        return True

    def _tell(self, given: _Given, confirmed: Moment | None, why: str | None) -> None:
        if confirmed is not None:
            self.confirmed.add(confirmed.t - given.asked.received.t)
        self._last = _told(given, confirmed, why)
        self._post(StopAnswered(self._last))

    def _answer(self, call: Call, result: dict[str, Any] | None) -> None:
        if not call.notification:
            self._send(answer(call.route, call.id, result))

    def _send(self, frames: Sequence[bytes]) -> None:
        # One that has gone or reads nothing is not waited for.
        with suppress(zmq.ZMQError):
            self._socket.send_multipart(frames, flags=zmq.NOBLOCK)


def _look_at(given: _Given) -> float:
    """Return when a stop is to be answered at the latest."""
    return given.due if given.motion is not None else given.loop_due


def _then(state: str) -> str:
    """Return the state that a stop takes the cell to, or leaves it in."""
    return state if state in (IDLE, FAULT) else STOPPING


def _told(given: _Given, confirmed: Moment | None, why: str | None) -> dict[str, Any]:
    """Return an answer: times in monotonic s, and in `wall` the same for people."""
    moments = {
        "received": given.asked.received,
        "commanded": given.commanded,
        "confirmed": confirmed,
    }
    return {
        "method": given.call.method,
        "by": given.asked.by,
        "state": given.state,
        **{name: m.t if m is not None else None for name, m in moments.items()},
        "reason": why,
        "wall": {name: _iso(m) if m is not None else None for name, m in moments.items()},
    }


def _iso(moment: Moment) -> str:
    return datetime.fromtimestamp(moment.wall, UTC).isoformat()
