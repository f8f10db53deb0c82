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


def interrupted(session: str, job: str) -> FaultReport:
    """Return the fault of a session that a daemon did not live to end."""
    text = f"the daemon ended while session {session} ({job}) was running"
    return FaultReport(
        Cause.INTERRUPTED, text, "see that the arm is clear of the leg, then send reset"
    )


def disk(error: RecordError) -> FaultReport:
    """Return the fault of a disk that did not take a record."""
    return FaultReport(Cause.DISK, error.text, error.hint)


def worker_gone(traceback: str) -> FaultReport:
    """Return the fault of a worker that has died."""
    hint = "report it with the daemon's log"
    return FaultReport(Cause.INTERNAL, "the worker has ended", hint, {"traceback": traceback})
