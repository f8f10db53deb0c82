"""Where the cell stands: its state, session, fault and what is known of its devices.

Every change is recorded and published here, and nowhere else. A fault is latched: its cause,
text and time stay until `clear`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any

from legato.control.settings import CellSettings
from legato.control.states import FAULT, IDLE, STOPPING, CellMachine, deadline
from legato.daemon import reports
from legato.daemon.admission import lacking
from legato.daemon.journal import Journal
from legato.daemon.log import Log
from legato.daemon.messages import FaultReport, View
from legato.daemon.sessions import Session, Sessions
from legato.daemon.status import status_told
from legato.hal.faults import Cause

if TYPE_CHECKING:
    from legato.records.store import Summary

HEARTBEAT_S = 1.0


@dataclass(frozen=True)
class Setting:
    """What is given once: the cell's settings, and what every record names."""

    settings: CellSettings
    boot: str
    clock: Callable[[], float]  # the cell's s
    min_free_mb: float = 0.0
    meta: Mapping[str, Any] = field(default_factory=dict)


class Standing:
    """The machine and what belongs to its state; `now` is the wall's monotonic s."""

    def __init__(
        self,
        setting: Setting,
        sessions: Sessions,
        journal: Journal,
        log: Log,
        *,
        now: float,
        fault: Mapping[str, Any] | None = None,
    ) -> None:
        self.sessions = sessions
        self.fault = dict(fault) if fault is not None else None
        self._view, self.views = View(), 0
        self.now = now
        self.began = now
        self._setting = setting
        self._journal = journal
        self._log = log
        self._machine = CellMachine(setting.settings.stations, FAULT if fault else IDLE)
        self._entered(now)
        self._stopped_by: str | None = None
        self.beat_at = now
        self._lacked: tuple[View, dict[str, dict[str, str]]] | None = None
        cause = self.fault["cause"] if self.fault else "start"
        journal.tell("state", {"state": self.state, "previous": None, "cause": cause})
        if self.fault:
            journal.tell("fault", self.fault | {"evidence": {}})

    @property
    def state(self) -> str:
        """The machine's state."""
        return self._machine.state

    @property
    def view(self) -> View:
        """What is known of the devices; `views` counts how often that was told anew."""
        return self._view

    @view.setter
    def view(self, view: View) -> None:
        self._view = view
        self.views += 1

    @property
    def running(self) -> bool:
        """Whether a job runs or is held."""
        return self.sessions.current is not None and self.state != FAULT

    @property
    def in_state_s(self) -> float:
        """How long the state has lasted."""
        return self.now - self._entered_at

    @property
    def due(self) -> float:
        """When the state's deadline is; infinity where it has none."""
        return self._due

    @property
    def uptime_s(self) -> float:
        """How long the daemon has run."""
        return round(self.now - self.began, 3)

    def status(self) -> dict[str, Any]:
        """Return what `status` answers."""
        told = status_told(
            self._setting.settings,
            self.view,
            self.state,
            self.sessions.current,
            self.fault,
            self._lacks(),
            clock=self._setting.clock(),
        )
        return told | {"boot": self._setting.boot, "uptime_s": self.uptime_s}

    def _lacks(self) -> dict[str, dict[str, str]]:
        """Return what an idle cell lacks; it changes with the view, which is new every second."""
        if self.state != IDLE:
            return {}
        if self._lacked is None or self._lacked[0] is not self.view:
            setting = self._setting
            self._lacked = self.view, lacking(self.view, setting.settings, setting.clock())
        return self._lacked[1]

    def is_current(self, session: str) -> bool:
        """Say whether a session is the one that runs."""
        return self.sessions.current is not None and self.sessions.current.id == session

    def enter(self, state: str, cause: str, by: str | None = None) -> None:
        """Go to a state, if not there already; `by` has asked for it. Raises NotAllowed."""
        previous = self.state
        if not self._machine.enter(state):
            return
        self._entered(self.now)
        if state == STOPPING:
            self._stopped_by = by
        change = {"state": state, "previous": previous, "cause": cause}
        change |= {"by": by} if by is not None else {}
        self._log.info("state", **change)
        self._journal.tell("state", change, durable=True)

    def _entered(self, now: float) -> None:
        limit = deadline(self.state)
        self._entered_at, self._due = now, now + limit if limit is not None else inf

    def begin(
        self,
        job: str,
        key: str | None,
        by: str,
        versions: Mapping[str, str],
        state: str,
        params: Mapping[str, Any] | None = None,
    ) -> Session:
        """Begin a session in the job's first state. Raises RecordError: then nothing has begun.

        Of `params`, `campaign` is not the request's: it names the campaign that has begun it.
        """
        params, self._stopped_by = dict(params or {}), None
        part = {"campaign": params.pop("campaign")} if "campaign" in params else {}
        meta = dict(self._setting.meta) | {
            "boot": self._setting.boot,
            "by": by,
            "params": params,
            **part,
            "simulated": self._setting.settings.simulated,
            "simulated_devices": list(self._setting.settings.simulated_devices),
            "versions": dict(versions),
        }
        session = self.sessions.begin(job, key, meta)
        # The state's line, right behind it, brings both to the disk.
        self._journal.tell("session", _told(session))
        self.enter(state, job, by)
        return session

    def happened(self, kind: str, data: Mapping[str, Any]) -> None:
        """Take in an event of the running session."""
        if kind == "progress" and self.sessions.current is not None:
            self.sessions.current.progress = data
        self._journal.tell(kind, data)

    def fail(self, report: FaultReport, by: str | None = None) -> None:
        """Latch a fault, unless one is latched already; `by` has asked for it."""
        if self.state == FAULT:
            return
        session = self.sessions.current
        evidence = {"state": self.state, "arm": dict(self.view.arm), **report.evidence}
        self.fault = {
            "cause": str(report.cause),
            "text": report.text,
            "hint": report.hint,
            "since": self.sessions.now(),
            "session": session.id if session else None,
        }
        self._log.error("fault", **self.fault)
        self.enter(FAULT, str(report.cause), by)
        self._journal.tell("fault", self.fault | {"evidence": evidence}, durable=True)
        self.keep()

    def clear(self) -> None:
        """Leave fault: the devices have answered."""
        self.fault = None
        self.enter(IDLE, "reset")

    def end(self, outcome: str, reason: str | None, cause: Cause | None) -> str:
        """Give the running session its outcome and return its id."""
        current = self.sessions.current
        assert current is not None, "only a running session ends"
        if outcome == "stopped" and reason is None and self._stopped_by is not None:
            reason = f"asked for by {self._stopped_by}"
        told = _told(current) | {"outcome": outcome, "reason": reason}
        self._journal.tell("session", told, durable=True)
        session = self.sessions.end(outcome, reason, cause)
        self._log.info("session", **session.told(), by=session.by)
        return session.id

    def end_in_fault(self) -> str:
        """Give the running session the fault as its outcome and return its id."""
        assert self.fault is not None, "state fault always has its fault"
        return self.end("fault", self.fault["text"], Cause(self.fault["cause"]))

    def known(self, view: View, older: "Sequence[Summary]" = ()) -> None:
        """Take in the devices, and older sessions; one that never got an end is a fault."""
        self.view = view
        for summary in older:
            if summary.outcome is None:
                self.fail(reports.interrupted(summary.id, summary.job))
                self.sessions.close(summary.id)
        self.sessions.learn(s for s in older if s.outcome is not None)
        self.keep()

    def look(self, view: View) -> None:
        """Take in what the idle worker has seen."""
        before, self.view = self.view, view
        if before.memory is not None and before.memory != view.memory:
            self.keep()
        for name in ("connected", "referenced"):
            if before.arm[name] and not view.arm[name]:
                self._log.warning(f"arm_not_{name}")

    def beat(self) -> None:
        """Publish the heartbeat where it is due; try again what the disk has not taken."""
        if self.now < self.beat_at:
            return
        self.beat_at = max(self.beat_at + HEARTBEAT_S, self.now)
        self.sessions.seal()
        self._journal.keep_again()
        self._journal.publish("heartbeat", {"state": self.state, "uptime_s": self.uptime_s})

    def keep(self) -> None:
        """Keep on disk what the next start must know."""
        self._journal.keep(self.fault, self.view)


def _told(session: Session) -> dict[str, Any]:
    return {
        "id": session.id,
        "job": session.job,
        "by": session.by,
        "outcome": None,
        "reason": None,
    }
