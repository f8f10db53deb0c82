"""What the last daemon has left: its fault, where the arm stood, sessions without an end.

A session that was running when a daemon died is closed as interrupted, and this one starts in
fault: a person must look before anything moves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from legato.daemon.log import Log
from legato.geometry.motion import Steps
from legato.hal.faults import Cause
from legato.records.errors import RecordError
from legato.records.store import Store, Summary


@dataclass(frozen=True)
class Past:
    """The latched fault if any, the sessions, and the last reference and registers."""

    fault: Mapping[str, Any] | None
    sessions: Sequence[Summary]
    last: tuple[Steps | None, Steps | None] = (None, None)


def read_past(store: Store, log: Log, *, simulated: bool) -> Past:
    """Return what there was, after closing what was left open. Raises RecordError."""
    state = _state(store, log)
    summaries = store.sessions()
    open_ones = [s for s in summaries if s.outcome is None]
    for summary in open_ones:
        store.close_interrupted(summary.id)
        log.warning("interrupted", session=summary.id, job=summary.job)
    fault = _fault(state.get("fault"))
    if open_ones:
        summaries = store.sessions()
        fault = _interrupted(open_ones[0])
    # A simulated world begins anew with each process: nothing of its arm outlives it.
    last = (None, None) if simulated else (_steps(state, "reference"), _steps(state, "registers"))
    return Past(fault, summaries, last)


def _state(store: Store, log: Log) -> Mapping[str, Any]:
    try:
        return store.load_state()
    except RecordError as error:
        # A file that cannot be read says nothing of the arm: it must be referenced again.
        log.warning("state_not_read", text=error.text, hint=error.hint)
        return {}


def _interrupted(summary: Summary) -> dict[str, Any]:
    return {
        "cause": str(Cause.INTERRUPTED),
        "text": f"the daemon ended while session {summary.id} ({summary.job}) was running",
        "hint": "see that the arm is clear of the leg, then send reset",
        "since": datetime.now(UTC).isoformat(),
        "session": summary.id,
    }


def _fault(kept: Any) -> dict[str, Any] | None:
    """Return the fault of state.json where it is one."""
    if not isinstance(kept, dict) or kept.get("cause") not in set(Cause):
        return None
    return {name: kept.get(name) for name in ("cause", "text", "hint", "since", "session")}


def _steps(state: Mapping[str, Any], name: str) -> Steps | None:
    """Return six whole numbers of state.json, None where they are not there."""
    kept = state.get(name)
    if not isinstance(kept, list) or [type(v) for v in kept] != [int] * 6:
        return None
    one, two, three, four, five, six = kept
    return one, two, three, four, five, six
