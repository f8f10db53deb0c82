"""Requests and the worker's messages in, decisions out; the loop's thread alone calls.

No socket and no device is touched here. Whatever is accepted ends in an outcome, every transient
state has a deadline, and after an estop the worker sends nothing more.
"""

from collections.abc import Mapping
from typing import Any

from legato.control.states import (
    FAULT,
    IDLE,
    STOPPING,
    NotAllowed,
)
from legato.daemon.admission import first_state, need_devices, need_knowledge, need_room
from legato.daemon.journal import Journal
from legato.daemon.log import Log
from legato.daemon.messages import (
    DevicesKnown,
    FaultReport,
    Happened,
    JobEnded,
    Looked,
    Message,
    Moved,
    StateWanted,
    TaskEnded,
    WorkerGone,
)
from legato.daemon.orders import DoJob, DoReference, DoReset, Orders, Quit
from legato.daemon.sessions import Session
from legato.daemon.standing import Setting, Standing
from legato.daemon.waiters import DEVICES, What
from legato.geometry.motion import ToolPose
from legato.hal.faults import Cause
from legato.records.errors import RecordError
from legato.records.store import Store
from legato.wire.jsonrpc import Failure

HEARTBEAT_S = 1.0
LET_GO_S = 5.0  # how long a dropped job's worker may hold back the session's outcome
CLOSE_S = 20.0  # how long a running job may take to retract at the end of the daemon


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
        self.settled: list[tuple[What, Mapping[str, Any] | Failure]] = []
        self.devices_known = False
        self.finished = False
        self.exit_code = 0
        self._setting = setting
        self._journal = journal
        self._orders = orders
        self._store = store
        self._log = log
        self._beat_at = standing.now
        self._busy: str | None = None
        self._token = 0
        self._resetting: int | None = None
        self._versions: Mapping[str, str] = {}
        self._closing_at: float | None = None
        self._quit_at: float | None = None

    @property
    def state(self) -> str:
        """The machine's state."""
        return self.standing.state

    # What requests ask for; each may raise Failure. The total table has been asked before.

    def start(self, job: str, key: str | None) -> Session:
        """Begin a job's session and hand it to the worker."""
        self._need_worker(job)
        view, settings = self.standing.view, self._setting.settings
        need_devices(job, view)
        need_knowledge(job, view, settings, self._setting.clock())
        need_room(self._store, self._setting.min_free_mb)
        first = first_state(job, settings.stations)
        try:
            session = self.standing.begin(job, key, self._versions, first)
        except RecordError as error:
            raise Failure("precondition", error.text, error.hint) from error
        assert session.writer is not None
        self._busy = job
        self._orders.give(DoJob(session.id, job, session.writer))
        self._see_disk()
        return session

    def stop(self) -> None:
        """Let the running job retract and end."""
        if self.state != STOPPING:
            self._orders.stop()
            self.standing.enter(STOPPING, "stop")
            self._see_disk()

    def pause(self) -> None:
        """Let the running job retract and hold at its next safe point."""
        self._orders.pause()

    def resume(self) -> None:
        """Let the held job go on."""
        self._orders.resume()

    def estop(self) -> None:
        """Let no further motion command go out, in any state."""
        self._orders.drop()
        if self._resetting is not None:
            no = Failure("in_fault", "an emergency stop came in between", "send reset again")
            self.settled.append((("task", self._resetting), no))
            self._resetting = None
        hint = "see that all is well, then send reset"
        self._fail(FaultReport(Cause.ESTOP, "an emergency stop was asked for", hint))

    def reset(self) -> int:
        """Ask the worker whether arm and camera answer; return the task's number."""
        if self._busy is not None:
            hint = "a device is slow to answer; try again in some seconds"
            raise Failure("unavailable", f"the worker has not let go of {self._busy} yet", hint)
        self._busy = "reset"
        self._token += 1
        self._resetting = self._token
        self._orders.give(DoReset(self._token))
        return self._token

    def reference(self, pose: ToolPose) -> int:
        """Let the worker take the arm to stand at a pose; return the task's number."""
        self._need_worker("reference")
        need_devices("reference", self.standing.view)
        self._busy = "reference"
        self._token += 1
        self._orders.give(DoReference(self._token, pose))
        return self._token

    def give_up(self, token: int) -> None:
        """Forget a task that nobody waits for any more: its late success changes no state."""
        if token == self._resetting:
            self._resetting = None

    def shutdown(self) -> None:
        """Begin to end: a running job retracts first."""
        if self._closing_at is None:
            self._closing_at = self.standing.now
            if self.standing.sessions.current is not None and self.state != FAULT:
                self.stop()

    # What the worker says, and time.

    def receive(self, message: Message) -> None:
        """Take in one message of the worker."""
        standing = self.standing
        match message:
            case DevicesKnown(view, versions):
                standing.view, self._versions, self.devices_known = view, versions, True
                standing.keep()
                self.settled.append((DEVICES, {}))
            case Looked(view):
                standing.look(view)
            case StateWanted(session, state):
                self._orders.answer(standing.is_current(session) and self._granted(state))
            case Happened(session, kind, data):
                if standing.is_current(session):
                    standing.happened(kind, data)
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
        self._see_disk()

    def tick(self, now: float) -> None:
        """Let time pass: deadlines, heartbeat, the end."""
        standing = self.standing
        standing.now = now
        if now > standing.due:
            text = f"{standing.state} has not ended within {standing.in_state_s:.0f} s"
            hint = "see the evidence for what it was doing; look at arm and camera, then reset"
            self._fail(FaultReport(Cause.DEADLINE, text, hint))
        stuck = standing.sessions.current is not None and standing.in_state_s > LET_GO_S
        if standing.state == FAULT and stuck:
            self._settle_session(standing.end_in_fault())
        if now >= self._beat_at:
            self._beat_at = max(self._beat_at + HEARTBEAT_S, now)
            standing.sessions.seal()
            beat = {"state": standing.state, "uptime_s": standing.uptime_s}
            self._journal.publish("heartbeat", beat)
        if self._closing_at is not None:
            self._close(now, self._closing_at)

    def next_due(self) -> float:
        """Return when `tick` is due next."""
        return min(self._beat_at, self.standing.due)

    # What follows from it.

    def _granted(self, state: str) -> bool:
        """Enter a state for a procedure; false where it may not, since a stop came first."""
        try:
            self.standing.enter(state, self._busy or "")
        except NotAllowed as error:
            self._log.info("not_entered", reason=str(error))
            return False
        return True

    def _job_ended(self, end: JobEnded) -> None:
        standing = self.standing
        self._busy, standing.view = None, end.view
        if standing.is_current(end.session):
            if end.fault is not None:
                self._fail(end.fault)
            if standing.state == FAULT:
                self._settle_session(standing.end_in_fault())
            else:
                outcome = end.outcome or "interrupted"
                standing.enter(IDLE, outcome)
                self._settle_session(standing.end(outcome, end.reason, end.cause))
        standing.keep()

    def _task_ended(self, end: TaskEnded) -> None:
        standing = self.standing
        self._busy, standing.view = None, end.view
        failure = Failure("unavailable", *end.problem) if end.problem is not None else None
        if end.token == self._resetting:
            self._resetting = None
            if failure is None:
                standing.clear()
        standing.keep()
        result = {"state": standing.state, "arm": dict(standing.view.arm)}
        self.settled.append((("task", end.token), failure or result))

    def _worker_gone(self, text: str | None) -> None:
        if text is not None:
            self._log.error("worker_gone", traceback=text)
            self.exit_code = 1
            hint = "report it with the daemon's log"
            evidence = {"traceback": text}
            self._fail(FaultReport(Cause.INTERNAL, "the worker has ended", hint, evidence))
        if self.standing.sessions.current is not None:
            self._settle_session(self.standing.end_in_fault())
        self.standing.keep()
        self.finished = True

    def _fail(self, report: FaultReport) -> None:
        """Latch a fault; nothing more goes to the arm."""
        self._orders.drop()
        self.standing.fail(report)

    def _settle_session(self, session: str) -> None:
        self.settled.append((("session", session), {}))

    def _see_disk(self) -> None:
        """Go to fault where the disk did not take a record."""
        error = self._journal.take_error()
        if error is not None:
            self._fail(FaultReport(Cause.DISK, error.text, error.hint))
            self._journal.take_error()

    def _close(self, now: float, since: float) -> None:
        """Go on ending: wait for the job, then for the worker, neither for ever."""
        if self.standing.sessions.current is not None:
            if now - since < CLOSE_S:
                return
            self._orders.drop()
            reason = "the daemon was told to end"
            self._settle_session(self.standing.end("interrupted", reason, Cause.INTERRUPTED))
        if self._quit_at is None:
            self._quit_at = now
            self._orders.give(Quit())
        elif now - self._quit_at > LET_GO_S:
            self.finished = True

    def _need_worker(self, job: str) -> None:
        if self._closing_at is not None:
            raise Failure("unavailable", "the daemon is shutting down", "start it again")
        if self._busy is not None:
            hint = "it ends by itself soon"
            raise Failure("busy", f"{job} must wait: the cell is busy with {self._busy}", hint)
