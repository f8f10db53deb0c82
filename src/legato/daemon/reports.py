"""The faults that the loop itself finds, each with what happened and what to do."""

from legato.daemon.messages import FaultReport
from legato.hal.faults import Cause
from legato.records.errors import RecordError


def estop(by: str | None) -> FaultReport:
    """Return the fault of an emergency stop that somebody asked for."""
    text = f"an emergency stop was asked for by {by or 'nobody known'}"
    return FaultReport(Cause.ESTOP, text, "see that all is well, then send reset", {"by": by})


def deadline(state: str, lasted_s: float) -> FaultReport:
    """Return the fault of a state that has not ended in its time."""
    text = f"{state} has not ended within {lasted_s:.0f} s"
    hint = "see the evidence for what it was doing; look at arm and camera, then reset"
    return FaultReport(Cause.DEADLINE, text, hint)


def disk(error: RecordError) -> FaultReport:
    """Return the fault of a disk that did not take a record."""
    return FaultReport(Cause.DISK, error.text, error.hint)


def worker_gone(traceback: str) -> FaultReport:
    """Return the fault of a worker that has died."""
    hint = "report it with the daemon's log"
    return FaultReport(Cause.INTERNAL, "the worker has ended", hint, {"traceback": traceback})
