"""What the last daemon has left: its fault, where the arm stood, sessions without an end.

A session that was running when a daemon died is closed as interrupted, and this one starts in
fault: a person must look before anything moves. However many sessions there were, only the latest
are read before the first client is answered.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final

from legato.daemon import reports
from legato.daemon.campaign_files import CampaignFiles, close_interrupted
from legato.daemon.log import Log
from legato.daemon.sessions import KEPT
from legato.geometry.motion import Steps
from legato.hal.faults import Cause
from legato.records.errors import RecordError
from legato.records.store import Store, Summary

if TYPE_CHECKING:
    from legato.config.schema import RobotTable

LATEST: Final = 200  # as many as a client may list


@dataclass(frozen=True)
class Past:
    """The latched fault if any, the sessions, and the arm's last reference and registers."""

    fault: Mapping[str, Any] | None
    sessions: Sequence[Summary]
    last: tuple[Steps | None, Steps | None] = (None, None)
    arm: str | None = None


def arm_name(robot: "RobotTable") -> str | None:
    """Return what tells this cell's arm from another, None for a simulated one."""
    return None if robot.driver == "sim" else f"{robot.driver} {robot.port}"


def read_past(store: Store, log: Log, *, arm: str | None) -> Past:
    """Return what there was, after closing what was left open. Raises RecordError.

    A disk that takes nothing keeps no daemon from starting: what it should hold is tried again.
    `arm` names the real arm of this cell, None where it is simulated: a simulated world begins
    anew with each process, and nothing of its arm outlives it.
    """
    state = _state(store, log)
    summaries = store.sessions(LATEST)
    open_ones = [s for s in summaries if s.outcome is None]
    fault = _fault(state.get("fault"))
    if open_ones:
        fault = _interrupted(open_ones[0])
        _close(store, log, {**state, "fault": fault}, open_ones)
    close_interrupted(CampaignFiles(store.state_dir), log)
    last = _arms_place(state) if arm is not None and arm == state.get("arm") else (None, None)
    return Past(fault, [_ended(s) for s in summaries], last, arm)


def _close(store: Store, log: Log, state: Mapping[str, Any], open_ones: Sequence[Summary]) -> None:
    """Keep the fault, then give each session its outcome, as far as the disk takes them."""
    try:
        # Before the sessions are closed: else a start that fails later would lose it.
        store.save_state(state)
        for summary in open_ones:
            store.close_interrupted(summary.id)
    except RecordError as error:
        log.error("sessions_not_closed", text=error.text, hint=error.hint)
    for summary in open_ones:
        log.warning("interrupted", session=summary.id, job=summary.job)


def _ended(summary: Summary) -> Summary:
    """Return a session that has an outcome, interrupted where its daemon gave it none."""
    if summary.outcome is not None:
        return summary
    report = reports.interrupted(summary.id, summary.job)
    cause = str(report.cause)
    return replace(summary, outcome="interrupted", reason=report.text, cause=cause)


def read_older(store: Store, log: Log) -> Sequence[Summary]:
    """Return the sessions before those of `read_past`, as many as are remembered."""
    try:
        return store.sessions(KEPT)[LATEST:]
    except RecordError as error:
        log.error("sessions_not_read", text=error.text, hint=error.hint)
        return ()


def _arms_place(state: Mapping[str, Any]) -> tuple[Steps | None, Steps | None]:
    """Return reference and registers, None where the registers would prove nothing.

    An arm that was switched off and moved by hand wakes up with zeros too.
    """
    reference, registers = _steps(state, "reference"), _steps(state, "registers")
    if registers is None or not any(registers):
        return None, None
    return reference, registers


def _state(store: Store, log: Log) -> Mapping[str, Any]:
    try:
        return store.load_state()
    except RecordError as error:
        # A file that cannot be read says nothing of the arm: it must be referenced again.
        log.warning("state_not_read", text=error.text, hint=error.hint)
        return {}


def _interrupted(summary: Summary) -> dict[str, Any]:
    report = reports.interrupted(summary.id, summary.job)
    return {
        "cause": str(report.cause),
        "text": report.text,
        "hint": report.hint,
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
