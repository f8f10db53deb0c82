"""Requests: each message alone is parsed, admitted by the total table, carried out and answered.

What cannot be answered at once waits here without blocking anybody. Junk is answered and counted.
"""

import traceback
from collections.abc import Callable, Mapping, Sequence
from typing import Any, assert_never

from msgspec import Raw

from legato.control.settings import CellSettings
from legato.control.table import CAMPAIGN, JOBS, METHODS, READERS, admit, authorise
from legato.daemon.asked import in_time, params_of, pose_of
from legato.daemon.conductor import Conductor
from legato.daemon.events import Events
from legato.daemon.log import Log
from legato.daemon.recent import Recent
from legato.daemon.sessions import Session as KnownSession
from legato.daemon.status import describe
from legato.daemon.waiters import DEVICES, Ask, Waiter, Waiters, What
from legato.daemon.who import LOCAL, Who
from legato.wire.jsonrpc import Failure, Malformed, answer, decode_params, receive, refuse
from legato.wire.requests import (
    Acting,
    Campaign,
    Campaigns,
    Describe,
    EndCampaign,
    Estop,
    EventsSince,
    Job,
    Lease,
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

TASK_S = 20.0  # how long reset and reference may take
# How long a job waits for devices that are being opened: less than any client waits, so that no
# job begins that somebody was told had failed.
JOB_WAIT_S = 3.0
STARTS = (*JOBS, CAMPAIGN)
NEED_DEVICES = (*STARTS, "reference", "reset")

Result = Mapping[str, Any] | Raw
Send = Callable[[list[bytes]], None]


class Desk:
    """Answers requests through `send`, in frames; the loop's thread alone uses it.

    `stops` tells the stop line's latencies, for status.
    """

    def __init__(
        self,
        conductor: Conductor,
        events: Events,
        settings: CellSettings,
        send: Send,
        log: Log,
        stops: Callable[[], Mapping[str, Any] | None] = lambda: None,
    ) -> None:
        self.junk = 0
        self._conductor = conductor
        self._events = events
        self._settings = settings
        self._send = send
        self._log = log
        self._stops = stops
        self._waiters = Waiters()
        self._acts = 0  # requests that may have changed something
        self._status = Recent(self._status_told)

    def receive(
        self, frames: Sequence[bytes], now: float, who: Who = LOCAL, since: int | None = None
    ) -> None:
        """Take in one message; whatever it is, nothing is raised.

        It came after the gate's first `since` stops, by default after all.
        """
        message = receive(frames)
        if isinstance(message, Malformed):
            self.junk += 1
            self._log.debug("junk", reason=message.failure.reason, count=self.junk)
            frames = refuse(message.route, message.id, message.failure, self._conductor.state)
            self._send(frames)
        else:
            stops = self._conductor.gate.number if since is None else since
            self._answer(Ask(message, who, stops), now)

    def settle(self, now: float) -> None:
        """Answer those whose wait has ended or whose time is up."""
        settled, self._conductor.settled = self._conductor.settled, []
        for what, result in settled:
            for ask in self._waiters.take(what):
                if what == DEVICES:
                    self._answer(ask, now)
                elif isinstance(result, Failure):
                    self._refuse(ask, result)
                else:
                    self._reply(ask, result or self._wait_told(str(what[1])))
        for waiter in self._waiters.take_due(now):
            self._out_of_time(waiter)

    def next_due(self) -> float:
        """Return when `settle` is due next."""
        return self._waiters.next_due()

    def close(self) -> None:
        """Answer all that still wait: the daemon ends."""
        for waiter in self._waiters.take_all():
            if waiter.what[0] == "session":
                self._reply(waiter.ask, self._wait_told(str(waiter.what[1])))
            else:
                self._refuse(waiter.ask, Failure("unavailable", "the daemon is shutting down"))

    def _answer(self, ask: Ask, now: float) -> None:
        """Carry out one request and answer it, now or later."""
        try:
            result = self._carried_out(ask, now)
        except Failure as failure:
            self._refuse(ask, failure)
        except Exception as error:  # noqa: BLE001  # a bug in one request must not reach the next
            self._log.error("bug", method=ask.call.method, traceback=traceback.format_exc())
            hint = "report it with the daemon's log"
            self._refuse(ask, Failure("internal_error", f"{type(error).__name__}: {error}", hint))
        else:
            if result is not None:
                self._reply(ask, result)

    def _carried_out(self, ask: Ask, now: float) -> Result | None:
        """Return the result of a request, None where it is answered later; raises Failure."""
        call = ask.call
        if call.method in METHODS:
            no = authorise(call.method, ask.who.role)
            if no is not None:
                raise Failure(no.code, no.reason, no.hint)
        request = decode_params(call)
        if call.method in READERS:  # whoever only looks is answered in every state
            return self._done(ask, request, now)
        self._acts += 1
        if isinstance(request, Job) and request.key is not None:
            known = self._conductor.standing.sessions.with_key(request.key)
            if known is not None:
                return self._repeated(call.method, known)
        if isinstance(request, Campaign) and request.key is not None:
            begun = self._conductor.campaigns.with_key(request)
            if begun is not None:
                return {"campaign": begun, "session": None, "state": self._conductor.state}
        if isinstance(request, Acting):
            in_time(request, now)
            self._conductor.leases.check(request.lease, ask.who, now)
        if call.method in NEED_DEVICES and not self._conductor.devices_known:
            patience = JOB_WAIT_S if call.method in STARTS else TASK_S
            return self._later(ask, DEVICES, now + patience)
        no = admit(call.method, self._conductor.state)
        # Between its repetitions nothing runs, and a stop still ends a campaign.
        ends = isinstance(request, Stop) and self._conductor.campaigns.underway is not None
        if no is not None and not ends:
            raise Failure(no.code, no.reason, no.hint)
        return self._done(ask, request, now)

    def _done(self, ask: Ask, request: Request, now: float) -> Result | None:
        """Carry out an admitted request."""
        conductor, by = self._conductor, ask.who.name
        match request:
            case Ping():
                return {"boot": self._events.boot, "state": conductor.state, "now": now}
            case Status():
                return self._status.told(now, self.version())
            case Describe():
                return describe(self._settings.stations)
            case Wait(session=session, timeout_s=timeout):
                told = self._wait_told(session)
                if told["outcome"] is not None or timeout == 0:
                    return told
                return self._later(ask, ("session", session), now + timeout)
            case Sessions(limit=limit):
                return {"sessions": conductor.standing.sessions.latest(limit)}
            case Session(session=session):
                return self._found(session).told()
            case EventsSince(boot=boot, seq=seq, limit=limit):
                return self._events.since(boot, seq, limit)
            case Job(key=key):
                params = params_of(request, self._settings)
                started = conductor.start(ask.call.method, key, by=by, since=ask.since, **params)
                return {"session": started.id, "state": conductor.state}
            case Campaign():
                begun = conductor.repeater.begin(request, by=by, since=ask.since, now=now)
                return begun | {"state": conductor.state}
            case EndCampaign():
                return conductor.campaigns.asked_to_end(by)
            case Campaigns():
                return conductor.campaigns.listed(request)
            case Pause():
                conductor.pause(by)
            case Resume():
                conductor.resume()
            case Stop():
                conductor.stop(by)
            case Estop():
                conductor.estop(by)
            case Reset():
                self._need_room()
                return self._later(ask, ("task", conductor.reset(by)), now + TASK_S)
            case Reference():
                self._need_room()
                token = conductor.reference(pose_of(request, self._settings))
                return self._later(ask, ("task", token), now + TASK_S)
            case Lease():
                return conductor.leases.ask(request, ask.who, now)
            case Shutdown():
                conductor.shutdown(by)
            case _:
                assert_never(request)
        current = conductor.standing.sessions.current
        return {"session": current.id if current else None, "state": conductor.state}

    def _status_told(self, now: float) -> Mapping[str, Any]:
        conductor = self._conductor
        told = conductor.standing.status() | {"lease": conductor.leases.told(now)}
        return told | {"stop": self._stops(), "campaign": conductor.campaigns.told()}

    def version(self) -> tuple[int, ...]:
        """Return what differs once something was asked for, seen or published."""
        conductor = self._conductor
        return self._events.seq, conductor.standing.views, conductor.gate.number, self._acts

    def _later(self, ask: Ask, what: What, due: float) -> Result | None:
        """Let a request wait; raises Failure."""
        self._need_room()
        self._waiters.add(ask, what, due)
        return None

    def _need_room(self) -> None:
        """Raise Failure where no more requests may wait."""
        if self._waiters.full:
            raise Failure("unavailable", "too many requests wait", "ask again later")

    def _out_of_time(self, waiter: Waiter) -> None:
        """Answer a request whose time is up."""
        what = waiter.what
        if what[0] == "session":
            self._reply(waiter.ask, self._wait_told(str(what[1])))
            return
        if what != DEVICES:
            self._conductor.tasks.give_up(int(what[1]))
        hint = "see status; try again when the devices answer"
        self._refuse(waiter.ask, Failure("unavailable", "the devices are slow to answer", hint))

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

    def _reply(self, ask: Ask, result: Result) -> None:
        call, by = ask.call, ask.who.name
        if not call.notification:
            self._send(answer(call.route, call.id, result))
        told = self._log.debug if call.method in READERS else self._log.info
        told("request", method=call.method, ok=True, by=by, state=self._conductor.state)

    def _refuse(self, ask: Ask, failure: Failure) -> None:
        call, state = ask.call, self._conductor.state
        self._log.info(
            "request", method=call.method[:64], ok=False, error=failure.name,
            reason=failure.reason, by=ask.who.name, state=state,
        )  # fmt: skip
        if not call.notification:
            self._send(refuse(call.route, call.id, failure, state))
