"""The jobs that a request starts, each a generator of effects that reads from top to bottom.

A job returns its outcome, `done` or `stopped`; it raises Refused or CellFault otherwise.
"""

from collections.abc import Generator
from typing import Any

from legato.control.checks import Check, picture_checks, second_picture_check
from legato.control.document import document
from legato.control.effects import (
    CellFault,
    Effect,
    Enter,
    Find,
    Grab,
    Refused,
    Save,
    Solve,
    StopRequested,
    Why,
)
from legato.control.massage import in_state, passes
from legato.control.memory import Memory
from legato.control.motion import Procedure, Track
from legato.control.perceive import Calibration
from legato.control.plan import plan_stations, transit
from legato.control.rehearsal import Way, problem
from legato.control.settings import CellSettings
from legato.control.states import CALIBRATE, CAPTURE, MOVE_HOME, STOPPING, VERIFY
from legato.control.strokes import Job
from legato.control.table import PRECONDITION, Refusal
from legato.control.verify import cell_checks
from legato.hal.faults import Cause, DeviceError

CALIBRATION_FILE = "calibration.json"


def procedure(
    job: str, settings: CellSettings, memory: Memory, now: float
) -> Generator[Effect, Any, str]:
    """Return the job's generator; `now` (monotonic s) dates a verified calibration."""
    track = Track(settings, memory)
    return _stoppable(track, _work(job, settings, memory, track, now))


def precondition(job: str, settings: CellSettings, memory: Memory, now: float) -> Refusal | None:
    """Return what a job needs and has not got, or None."""
    if job in ("run", "home", "massage") and memory.steps() is None:
        hint = "bring the arm to a known pose and send reference with that pose"
        return Refusal(PRECONDITION, "the arm is not referenced", hint)
    if job == "calibrate" and memory.frame is None:
        return Refusal(PRECONDITION, "there is no picture to calibrate from", "send capture first")
    if job == "verify" and memory.calibration is None:
        return Refusal(PRECONDITION, "there is no calibration to verify", "send calibrate first")
    if job == "massage":
        return _massage_precondition(settings, memory, now)
    return None


def _massage_precondition(settings: CellSettings, memory: Memory, now: float) -> Refusal | None:
    if memory.calibration is None or memory.verified_at is None:
        hint = "send capture, calibrate and verify first, or run"
        return Refusal(PRECONDITION, "there is no verified calibration", hint)
    age, fresh = now - memory.verified_at, settings.calibration.fresh_s
    if age > fresh:
        reason = f"the verified calibration is {age:.0f} s old, {fresh:.0f} s are allowed"
        return Refusal(PRECONDITION, reason, "send capture, calibrate and verify again")
    return None


def _stoppable(track: Track, work: Procedure) -> Generator[Effect, Any, str]:
    """Carry out a job; on a stop retract where the fingertip is at the leg, and end as stopped."""
    try:
        yield from work
    except StopRequested:
        yield Enter(STOPPING)
        yield from track.retreat()
        return "stopped"
    except (CellFault, DeviceError, Refused):
        raise
    except Exception:
        # Trouble that is not the arm's, such as a full disk: come off the leg first.
        yield from track.retreat()
        raise
    return "done"


def _work(job: str, settings: CellSettings, memory: Memory, track: Track, now: float) -> Procedure:
    """Return the generator of one job's own part."""
    match job:
        case "run":
            return _run(settings, memory, track, now)
        case "capture":
            return _capture(memory)
        case "calibrate":
            return _calibrate(settings, memory)
        case "verify":
            return _verify(settings, memory, now)
        case "home":
            return _home(settings, memory, track)
        case "massage":
            return _massage(settings, memory, track)
    raise ValueError(f"there is no job {job}")


def _run(settings: CellSettings, memory: Memory, track: Track, now: float) -> Procedure:
    yield from _capture(memory)
    yield from _calibrate(settings, memory)
    yield from _verify(settings, memory, now)
    yield from _home(settings, memory, track)
    yield from _massage(settings, memory, track)
    yield from _home(settings, memory, track)


def _capture(memory: Memory) -> Procedure:
    yield Enter(CAPTURE)
    memory.frame = None
    memory.frame = yield Grab("capture")


def _calibrate(settings: CellSettings, memory: Memory) -> Procedure:
    yield Enter(CALIBRATE)
    memory.calibration = memory.verified_at = None
    calibration: Calibration = yield Solve(memory.frame, memory.picks)  # type: ignore[arg-type] # precondition
    memory.calibration = calibration
    yield Save(CALIBRATION_FILE, document(calibration, settings))


def _verify(settings: CellSettings, memory: Memory, now: float) -> Procedure:
    """Hold the calibration to every test; Refused with each reason where one fails."""
    yield Enter(VERIFY)
    memory.verified_at = None
    calibration = memory.calibration
    assert calibration is not None, "precondition of verify"
    second = yield Find((yield Grab("verify")), memory.picks)
    checks: list[Check] = [
        *picture_checks(calibration, settings),
        second_picture_check(calibration, second, settings),
        *cell_checks(calibration, settings),
    ]
    yield Save(CALIBRATION_FILE, document(calibration, settings, checks))
    failed = tuple(c.text for c in checks if not c.ok)
    if failed:
        memory.calibration = None
        raise Refused(Cause.CALIBRATION_REJECTED, failed)
    memory.verified_at = now


def _home(settings: CellSettings, memory: Memory, track: Track) -> Procedure:
    def work() -> Procedure:
        yield from track.read()
        _see_the_way(settings, memory, track)
        yield from track.travel(settings.home)

    yield from in_state(track, MOVE_HOME, work)


def _see_the_way(settings: CellSettings, memory: Memory, track: Track) -> None:
    """Raise Refused, before the first motion, where the way home is not clear."""
    leg = memory.calibration.world_from_object if memory.calibration is not None else None
    way = Way((track.pose, *transit(settings, track.pose, settings.home)), Why.TRANSIT)
    found = problem(settings, leg, way)
    if found:
        raise Refused(Cause.LIMIT, (f"the way home is not clear: {found}",))


def _see_the_way_on(settings: CellSettings, calibration: Calibration, track: Track) -> None:
    """Raise Refused, before the first motion, where the way to the first station is not clear.

    Verify has rehearsed it from home; the arm may stand elsewhere.
    """
    first = plan_stations(settings, calibration)[0]
    way = Way((track.pose, *transit(settings, track.pose, first.lead_in)), Why.TRANSIT)
    found = problem(settings, calibration.world_from_object, way)
    if found:
        where = f"the way to station {first.station:g} mm is not clear"
        raise Refused(Cause.LIMIT, (f"{where}: {found}",))


def _massage(settings: CellSettings, memory: Memory, track: Track) -> Procedure:
    assert memory.calibration is not None, "precondition of massage"
    _see_the_way_on(settings, memory.calibration, track)
    try:
        yield from passes(Job(settings, memory.calibration, track))
    except CellFault:
        # Contact where none was predicted, or none where it was: the calibration no longer holds.
        memory.verified_at = None
        raise
