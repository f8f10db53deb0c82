"""One answer for every pair of state and method: the total table of what may be asked when."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from legato.control.states import FAULT, IDLE, MOVE_HOME, PAUSED, STOPPING, states

JOBS: Final = ("run", "capture", "calibrate", "verify", "home", "massage")
READERS: Final = ("ping", "status", "describe", "wait", "sessions", "session", "events_since")
ALWAYS: Final = (*READERS, "estop", "shutdown")
METHODS: Final = (*ALWAYS, *JOBS, "pause", "resume", "stop", "reset", "reference")

REFUSED_IN_STATE: Final = "refused_in_state"
BUSY: Final = "busy"
IN_FAULT: Final = "in_fault"
PRECONDITION: Final = "precondition"
UNAVAILABLE: Final = "unavailable"


@dataclass(frozen=True)
class Refusal:
    """Why a request is not carried out: an error's name on the wire, a reason, and what to do."""

    code: str
    reason: str
    hint: str


def admit(method: str, state: str) -> Refusal | None:
    """Return None where `method` fits `state`, else the refusal. KeyError for an unknown method."""
    if method not in METHODS:
        raise KeyError(method)
    if method in ALWAYS:
        return None
    if method == "reset":
        return None if state == FAULT else _unfit(method, state, "only a fault is reset")
    if state == FAULT:
        hint = "read the fault in status, clear its cause, then send reset"
        return Refusal(IN_FAULT, f"{method} is not possible in fault", hint)
    if method in (*JOBS, "reference"):
        return None if state == IDLE else _busy(method, state)
    if method == "pause":
        return None if _pausable(state) else _unfit(method, state, "only motion can be paused")
    if method == "resume":
        return None if state == PAUSED else _unfit(method, state, "nothing is paused")
    return _unfit(method, state, "nothing is running") if state == IDLE else None


def describe_table(stations: Iterable[float]) -> list[dict[str, str]]:
    """Return the table's rows for people and clients: state, method, answer, reason, hint."""
    table = []
    for state in states(stations):
        for method in METHODS:
            no = admit(method, state)
            row = {"state": state, "method": method, "answer": no.code if no else "accepted"}
            table.append(row | ({"reason": no.reason, "hint": no.hint} if no else {}))
    return table


def _pausable(state: str) -> bool:
    return state == MOVE_HOME or state.startswith("massage_")


def _unfit(method: str, state: str, why: str) -> Refusal:
    return Refusal(REFUSED_IN_STATE, f"{method} does not fit state {state}", why)


def _busy(method: str, state: str) -> Refusal:
    end = "it ends by itself soon" if state == STOPPING else "wait for its end, or send stop"
    return Refusal(BUSY, f"{method} must wait: the cell is in {state}", end)
