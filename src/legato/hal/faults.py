"""The fixed list of fault causes and the error that a driver raises with one of them."""

from enum import StrEnum


class Cause(StrEnum):
    """Why the cell is in fault; the names are part of the wire."""

    ESTOP = "estop"
    CAMERA_LOST = "camera_lost"
    CAMERA_STALE = "camera_stale"
    MARKS_NOT_FOUND = "marks_not_found"
    CALIBRATION_REJECTED = "calibration_rejected"
    ARM_LOST = "arm_lost"
    ARM_TIMEOUT = "arm_timeout"
    ARM_REFUSED = "arm_refused"
    ARM_STOPPED_BY_PENDANT = "arm_stopped_by_pendant"
    FOLLOWING_ERROR = "following_error"
    CONTACT_EARLY = "contact_early"
    CONTACT_LATE = "contact_late"
    LIMIT = "limit"
    LEG_MOVED = "leg_moved"
    DEADLINE = "deadline"
    LEASE_LOST = "lease_lost"
    DISK = "disk"
    INTERRUPTED = "interrupted"
    INTERNAL = "internal"


class DeviceError(Exception):
    """A device did not do what was asked: cause, what happened, and what to do about it."""

    def __init__(self, cause: Cause, text: str, hint: str = "") -> None:
        self.cause = cause
        self.text = text
        self.hint = hint
        super().__init__(f"{cause}: {text}" + (f" ({hint})" if hint else ""))
