"""One answer for every pair of state and method: the total table of what may be asked when."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from legato.control.states import FAULT, IDLE, MOVE_HOME, PAUSED, STOPPING, states

JOBS: Final = ("run", "capture", "calibrate", "verify", "home", "massage")
CAMPAIGN: Final = "campaign"
READERS: Final = (
    "ping", "status", "describe", "wait", "sessions", "session", "events_since", "campaigns",
)  # fmt: skip
ALWAYS: Final = (*READERS, "estop", "shutdown", "lease", "end_campaign")
METHODS: Final = (*ALWAYS, *JOBS, CAMPAIGN, "pause", "resume", "stop", "reset", "reference")
STOPS: Final = ("stop", "estop")
ACTING: Final = (
    *JOBS, CAMPAIGN, "end_campaign", "pause", "resume", "reset", "reference", "shutdown",
)  # fmt: skip
"""What a lease keeps for its holder; nobody ever needs one to stop."""

OPERATOR: Final = "operator"
ROLES: Final = {
    "observer": READERS,
    "stopper": (*READERS, *STOPS),
    OPERATOR: METHODS,
}
"""What each role of a client's key may ask for."""

REFUSED_IN_STATE: Final = "refused_in_state"
BUSY: Final = "busy"
IN_FAULT: Final = "in_fault"
PRECONDITION: Final = "precondition"
NOT_AUTHORISED: Final = "not_authorised"


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
    if method in (*JOBS, CAMPAIGN, "reference"):
        return None if state == IDLE else _busy(method, state)
    if method == "pause":
        return None if pausable(state) else _unfit(method, state, "only motion can be paused")
    if method == "resume":
        return None if state == PAUSED else _unfit(method, state, "nothing is paused")
    return _unfit(method, state, "nothing is running") if state == IDLE else None


def authorise(method: str, role: str) -> Refusal | None:
    """Return None where a client of this role may ask for `method` at all, else the refusal."""
    if method in ROLES.get(role, ()):
        return None
    able = ", ".join(name for name, methods in ROLES.items() if method in methods)
    hint = f"ask with a key of role {able}"
    return Refusal(NOT_AUTHORISED, f"{method} is not for role {role}", hint)


def describe_table(stations: Iterable[float]) -> list[dict[str, str]]:
    """Return the table's rows for people and clients: state, method, answer, reason, hint."""
    table = []
    for state in states(stations):
        for method in METHODS:
            no = admit(method, state)
            row = {"state": state, "method": method, "answer": no.code if no else "accepted"}
            table.append(row | ({"reason": no.reason, "hint": no.hint} if no else {}))
    return table


def pausable(state: str) -> bool:
    """Say whether a job in this state can be told to hold."""
    return state == MOVE_HOME or state.startswith("massage_")


def _unfit(method: str, state: str, why: str) -> Refusal:
    return Refusal(REFUSED_IN_STATE, f"{method} does not fit state {state}", why)


def _busy(method: str, state: str) -> Refusal:
    end = "it ends by itself soon" if state == STOPPING else "wait for its end, or send stop"
    return Refusal(BUSY, f"{method} must wait: the cell is in {state}", end)
