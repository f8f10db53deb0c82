"""Requests and the worker's messages in, decisions out; the loop's thread alone calls.

No socket and no device is touched here. Whatever is accepted ends in an outcome, every transient
state has a deadline, and after an estop the worker sends nothing more.
"""

from collections.abc import Mapping
from typing import Any

from legato.control.states import FAULT, IDLE, PAUSED, STOPPING, NotAllowed
from legato.control.table import pausable
from legato.daemon import reports
from legato.daemon.admission import (
    first_state,
    need_all,
    need_devices,
    need_free_worker,
    need_worker,
)
from legato.daemon.campaigns import campaigns_of
from legato.daemon.closing import LET_GO_S, Closing
from legato.daemon.faulting import Faulting
from legato.daemon.journal import Journal
from legato.daemon.lease import Leases
from legato.daemon.log import Log, note
from legato.daemon.messages import (
    DevicesKnown,
    Happened,
    JobEnded,
    Looked,
    Message,
    Moved,
    StateWanted,
    TaskEnded,
    WorkerGone,
)
from legato.daemon.orders import DoJob, Orders
from legato.daemon.repeat import Repeater
from legato.daemon.sessions import Session
from legato.daemon.standing import Setting, Standing
from legato.daemon.tasks import Tasks
from legato.daemon.waiters import DEVICES, What
from legato.geometry.motion import ToolPose
from legato.records.errors import RecordError
from legato.records.store import Store
from legato.wire.jsonrpc import Failure


class Conductor:
    """Decides what follows from what was asked and what has happened."""

    def __init__(
        self,
        setting: Setting,
        standing: Standing,
        journal: Journal,
        orders: Orders,
        store: Store,
        log: Log,
    ) -> None:
        self.standing = standing
        self.leases = Leases(log)
        self.tasks = Tasks(orders)
        self.settled: list[tuple[What, Mapping[str, Any] | Failure]] = []
        self.devices_known = False
        self.finished = False
        self.exit_code = 0
        self._setting = setting
        self._journal = journal
        self._orders = orders
        self._store = store
        self._log = log
        self.gate = orders.gate
        self._pause_for: tuple[str, str | None] = ("pause", None)
        self._busy: str | None = None
        self._versions: Mapping[str, str] = {}
        self._closing: Closing | None = None
        self._faulting = Faulting(standing, journal, orders)
        self.campaigns = campaigns_of(setting, standing, journal, store, log, self.tasks)
        self.repeater = Repeater(self.campaigns, self.leases, self.start, self.reset)

    @property
    def state(self) -> str:
        """The machine's state."""
        return self.standing.state

    # What requests ask for; each may raise Failure. The total table has been asked before.

    def start(self, job: str, key: str | None, *, by: str, since: int, **params: Any) -> Session:
        """Begin a job's session and hand it to the worker.

        A stop after the gate's first `since` came after this request was sent.
        """
        if "campaign" not in params:
            self.campaigns.need_none(job)
        need_worker(job, self._busy, ending=self._closing is not None)
        if self.gate.stopped_since(since):
            hint = "send it again if it is still wanted"
            raise Failure("expired", f"a stop came while {job} waited its turn", hint)
        need_all(job, self.standing.view, self._setting, self._store)
        first = first_state(job, self._setting.settings.stations)
        try:
            session = self.standing.begin(job, key, by, self._versions, first, params)
        except RecordError as error:
            raise Failure("precondition", error.text, error.hint) from error
        assert session.writer is not None
        self._busy = job
        self._orders.give(DoJob(session.id, job, session.writer, params), since)
        self._faulting.see_disk()
        return session

    def stop(self, by: str | None = None) -> None:
        """Let the running job retract and end; a campaign ends with it, or at once between jobs."""
        self.campaigns.end("stopped", f"stopped by {by or 'nobody known'}")
        if self.standing.running and self.state != STOPPING:
            self._orders.stop()
            self.standing.enter(STOPPING, "stop", by)
            self._faulting.see_disk()

    def pause(self, by: str | None = None, cause: str = "pause") -> None:
        """Let the running job retract and hold."""
        self._pause_for = cause, by
        self._orders.pause()

    def resume(self) -> None:
        """Let the held job go on."""
        self._orders.resume()

    def estop(self, by: str | None = None) -> None:
        """Let no further motion command go out, in any state."""
        self._orders.drop()
        self.campaigns.end("fault", reports.estop(by).text)
        broken_off = self.tasks.break_off()
        if broken_off is not None:
            no = Failure("in_fault", "an emergency stop came in between", "send reset again")
            self.settled.append((("task", broken_off), no))
        self._faulting.fail(reports.estop(by), by)

    def reset(self, by: str | None = None) -> int:
        """Ask the worker whether arm and camera answer; return the task's number."""
        need_free_worker(self._busy)
        if by is not None:  # a person is there, and takes the cell over
            self.campaigns.end("stopped", f"{by} has sent reset")
        self._busy = "reset"
        return self.tasks.reset()

    def reference(self, pose: ToolPose) -> int:
        """Let the worker take the arm to stand at a pose; return the task's number."""
        self.campaigns.need_none("reference")
        need_worker("reference", self._busy, ending=self._closing is not None)
        need_devices("reference", self.standing.view)
        self._busy = "reference"
        return self.tasks.reference(pose)

    def shutdown(self, by: str | None = None) -> None:
        """Begin to end: a running job retracts first."""
        if self._closing is None:
            self._closing = Closing(self._orders)
            self.campaigns.end("interrupted", "the daemon was told to end")
            if self.standing.sessions.current is not None and self.state != FAULT:
                self.stop(by)

    def receive(self, message: Message) -> None:
        """Take in one message of another thread."""
        self._see_gate()
        standing = self.standing
        match message:
            case DevicesKnown(view, versions, older):
                self._versions, self.devices_known = versions, True
                standing.known(view, older)
                self.settled.append((DEVICES, {}))
            case Looked(view):
                standing.look(view)
            case StateWanted(session, state):
                self._orders.answer(standing.is_current(session) and self._granted(state))
            case Happened(session, kind, data):
                if standing.is_current(session):
                    standing.happened(kind, data)
                    if kind == "contact":
                        self.campaigns.touch(data)
            case Moved(session, view, data):
                standing.view = view
                if standing.is_current(session):
                    self._journal.publish("telemetry", data)
            case JobEnded():
                self._job_ended(message)
            case TaskEnded():
                self._task_ended(message)
            case WorkerGone(text):
                self._worker_gone(text)
            case _:
                note(self._log, message)
        self._faulting.see_disk()

    def wake(self, now: float) -> None:
        """Take in the time and every stop before what else has come: a stop stops no later job."""
        self.standing.now = now
        self._see_gate()

    def tick(self, now: float) -> None:
        """Let time pass: deadlines, heartbeat, the end."""
        self.wake(now)
        standing = self.standing
        self._see_lease(now)
        if now > standing.due:
            self._faulting.fail_after_retreat(reports.deadline(standing.state, standing.in_state_s))
        stuck = standing.sessions.current is not None and standing.in_state_s > LET_GO_S
        if standing.state == FAULT and stuck:
            self._settle_session(standing.end_in_fault())
        standing.beat()
        if self._closing is not None:
            self._close(self._closing, now)
        elif self.campaigns.current is not None:
            self.repeater.go_on(self.state, standing.fault, now, free=self._busy is None)

    def next_due(self) -> float:
        """Return when `tick` is due next."""
        due = min(self.standing.beat_at, self.standing.due, self.leases.next_due())
        if self.campaigns.current is None:
            return due
        return min(due, self.campaigns.next_due(self.standing.now))

    def _see_gate(self) -> None:
        """Follow what the stop line has asked for; the worker heeds it without waiting for this."""
        for asked in self.gate.news():
            if asked.estop:
                self.estop(asked.by)
            else:
                self.stop(asked.by)

    def _see_lease(self, now: float) -> None:
        """Pause where the operator who asked for a deadman has not renewed the lease."""
        running, can = self.standing.running, pausable(self.state)
        unmanned = self.leases.unmanned(now, running=running, pausable=can)
        if unmanned is not None:
            self.pause(unmanned, "lease_lost")

    def _granted(self, state: str) -> bool:
        """Enter a state for a procedure; false where it may not, since a stop came first."""
        cause, by = self._pause_for if state == PAUSED else (self._busy or "", None)
        try:
            self.standing.enter(state, "stop" if state == STOPPING else cause, by)
        except NotAllowed as error:
            self._log.info("not_entered", reason=str(error))
            return False
        self._see_lease(self.standing.now)
        return True

    def _job_ended(self, end: JobEnded) -> None:
        standing = self.standing
        self._busy, standing.view = None, end.view
        if standing.is_current(end.session):
            fault = self._faulting.to_come or end.fault
            if fault is not None:
                self._faulting.fail(fault)
            if standing.state == FAULT:
                self._settle_session(standing.end_in_fault())
            else:
                outcome = end.outcome or "interrupted"
                if standing.state == STOPPING and outcome == "done":
                    outcome = "stopped"  # asked for while the last effect was under way
                standing.enter(IDLE, outcome)
                self._settle_session(standing.end(outcome, end.reason, end.cause))
        standing.keep()

    def _task_ended(self, end: TaskEnded) -> None:
        standing = self.standing
        self._busy, standing.view = None, end.view
        failure = Failure("unavailable", *end.problem) if end.problem is not None else None
        if self.tasks.ended(end.token, well=failure is None):
            standing.clear()
        self.campaigns.end_task(end.token, failure.reason if failure else None, standing.now)
        standing.keep()
        result = {"state": standing.state, "arm": dict(standing.view.arm)}
        self.settled.append((("task", end.token), failure or result))

    def _worker_gone(self, text: str | None) -> None:
        if text is not None:
            self._log.error("worker_gone", traceback=text)
            self.exit_code = 1
            self._faulting.fail(reports.worker_gone(text))
        if self.standing.sessions.current is not None:
            self._settle_session(self.standing.end_in_fault())
        self.standing.keep()
        self.finished = True

    def _settle_session(self, session: str) -> None:
        known = self.standing.sessions.find(session)
        if known is not None:
            self.campaigns.end_session(known, self.standing.now)
        self.settled.append((("session", session), {}))

    def _close(self, closing: Closing, now: float) -> None:
        """Go on ending: wait for the job, then for the worker, neither for ever."""
        running = self.standing.sessions.current is not None
        if running and self.state == FAULT:  # nothing more of it is sent, and nobody waits for it
            self._settle_session(self.standing.end_in_fault())
            running = False
        self.finished = self.finished or closing.over(now, running=running)
