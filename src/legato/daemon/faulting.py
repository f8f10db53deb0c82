"""The way into fault: at once, or once a job has come off the leg. One at a time; then latched.

Whatever the cause, nothing new goes to the arm once the fault is latched.
"""

from dataclasses import replace

from legato.control.states import STOPPING, moves
from legato.daemon import reports
from legato.daemon.journal import Journal
from legato.daemon.messages import FaultReport
from legato.daemon.orders import Orders
from legato.daemon.standing import Standing


class Faulting:
    """Latches faults; `to_come` is one that waits for the job to come off the leg."""

    def __init__(self, standing: Standing, journal: Journal, orders: Orders) -> None:
        self.to_come: FaultReport | None = None
        self._standing = standing
        self._journal = journal
        self._orders = orders

    def fail(self, report: FaultReport, by: str | None = None) -> None:
        """Latch a fault, with what the job did last; `by` has asked for it."""
        self.to_come = None
        self._orders.drop()
        if self._standing.sessions.current is not None:
            evidence = self._orders.trail.evidence() | dict(report.evidence)
            report = replace(report, evidence=evidence)
        self._standing.fail(report, by)

    def fail_after_retreat(self, report: FaultReport) -> None:
        """Latch a fault that is not the arm's own once the job has come off the leg.

        The retreat is a stop like any other, with that state's deadline.
        """
        state = self._standing.state
        if not moves(state) or state == STOPPING:
            self.fail(self.to_come or report)
            return
        self.to_come = report
        self._orders.stop()
        self._standing.enter(STOPPING, str(report.cause))

    def see_disk(self) -> None:
        """Go to fault where the disk did not take a record."""
        error = self._journal.take_error()
        if error is None or self.to_come is not None:
            return
        if self._standing.state == STOPPING:
            self.to_come = reports.disk(error)  # the way off the leg that is under way goes on
        else:
            self.fail_after_retreat(reports.disk(error))
        self._journal.take_error()
