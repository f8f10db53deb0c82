"""What a job begins with, and what it needs beyond a fitting state: devices, knowledge, room.

Each check raises the Failure that the client is told.
"""

from typing import TYPE_CHECKING

from legato.control.settings import CellSettings
from legato.control.states import CALIBRATE, CAPTURE, MOVE_HOME, VERIFY, massage_state
from legato.control.table import JOBS
from legato.daemon.messages import View
from legato.records.errors import RecordError
from legato.records.store import Store
from legato.wire.jsonrpc import Failure

if TYPE_CHECKING:
    from legato.daemon.standing import Setting

CAMERA_JOBS = ("run", "capture", "verify")
ARM_JOBS = ("run", "home", "massage", "reference")


def first_state(job: str, stations: tuple[float, ...]) -> str:
    """Return the state that a job begins in; its procedure enters it too."""
    return {
        "run": CAPTURE,
        "capture": CAPTURE,
        "calibrate": CALIBRATE,
        "verify": VERIFY,
        "home": MOVE_HOME,
        "massage": massage_state(stations[0]),
    }[job]


def need_worker(job: str, busy: str | None, *, ending: bool) -> None:
    """Raise Failure where the daemon is ending, or the worker busy with something."""
    if ending:
        raise Failure("unavailable", "the daemon is shutting down", "start it again")
    if busy is not None:
        reason = f"{job} must wait: the cell is busy with {busy}"
        raise Failure("busy", reason, "it ends by itself soon")


def need_free_worker(busy: str | None) -> None:
    """Raise Failure where the worker of a job that was dropped has not let go of it."""
    if busy is not None:
        hint = "a device is slow to answer; try again in some seconds"
        raise Failure("unavailable", f"the worker has not let go of {busy} yet", hint)


def need_all(job: str, view: View, setting: "Setting", store: Store) -> None:
    """Raise Failure where a job lacks devices, knowledge or room for its record."""
    need_devices(job, view)
    need_knowledge(job, view, setting.settings, setting.clock())
    need_room(store, setting.min_free_mb)


def lacking(view: View, settings: CellSettings, now: float) -> dict[str, dict[str, str]]:
    """Return the requests that idle admits and the cell cannot serve: reason and hint of each.

    Room on the disk is not looked at. `now` is the cell's clock in s.
    """
    found = {}
    for job in (*JOBS, "reference") if view.memory is not None else ():
        try:
            need_devices(job, view)
            need_knowledge(job, view, settings, now)
        except Failure as no:
            found[job] = {"reason": no.reason, "hint": no.hint}
    return found


def need_devices(job: str, view: View) -> None:
    """Raise Failure(unavailable) where the job's devices are not connected."""
    hint = "see that it is on and plugged in; it is looked for by itself"
    if job in ARM_JOBS and not view.arm["connected"]:
        raise Failure("unavailable", "the arm is not connected", hint)
    if job in CAMERA_JOBS and not view.camera_connected:
        raise Failure("unavailable", "the camera is not connected", hint)


def need_knowledge(job: str, view: View, settings: CellSettings, now: float) -> None:
    """Raise Failure(precondition) where reference, picture or calibration is missing or old.

    `now` is the cell's clock in s.
    """
    # The worker has loaded what this needs before the first job can get here.
    from legato.control.jobs import precondition

    assert view.memory is not None, "jobs wait until the devices are known"
    no = precondition(job, settings, view.memory, now)
    if no is not None:
        raise Failure(no.code, no.reason, no.hint)


def need_room(store: Store, min_free_mb: float) -> None:
    """Raise Failure(precondition) where the disk has no room for a record."""
    try:
        free = store.free_mb()
    except RecordError as error:
        raise Failure("precondition", error.text, error.hint) from error
    if free < min_free_mb:
        reason = f"{free:.0f} MB are free for records, {min_free_mb:g} are needed"
        raise Failure("precondition", reason, "free space, or see records.keep_days")
