"""The fixed list of fault causes and the error that a driver raises with one of them."""

from enum import StrEnum


class Cause(StrEnum):
    """Why the cell is in fault; the names are part of the wire."""

    ESTOP = "estop"
    """Somebody asked for an emergency stop. No further motion was sent."""
    CAMERA_LOST = "camera_lost"
    """The camera gives no picture, or one of another size, and trying again did not help."""
    CAMERA_STALE = "camera_stale"
    """The camera gives only pictures older than `camera.max_age_s`."""
    MARKS_NOT_FOUND = "marks_not_found"
    """The leg's marks cannot be told in the picture, so nothing can be solved."""
    CALIBRATION_REJECTED = "calibration_rejected"
    """Verify does not trust the pose. A session ends as refused by it, without a fault."""
    ARM_LOST = "arm_lost"
    """The arm's line is gone, or what comes on it is no TeachMover's."""
    ARM_TIMEOUT = "arm_timeout"
    """The arm did not answer in time. Whether it moved is not known."""
    ARM_REFUSED = "arm_refused"
    """The arm refused a command. Nothing has moved."""
    ARM_STOPPED_BY_PENDANT = "arm_stopped_by_pendant"
    """STOP was pressed on the teach pendant. The motion was broken off."""
    FOLLOWING_ERROR = "following_error"
    """The arm's registers do not read what was commanded."""
    CONTACT_EARLY = "contact_early"
    """The grip switch closed higher than the contact window allows."""
    CONTACT_LATE = "contact_late"
    """The grip switch stayed open down to the end of the contact window."""
    LIMIT = "limit"
    """A motion was not sent: it would leave joint limits, the workspace, or come too close."""
    LEG_MOVED = "leg_moved"
    """A station is touched elsewhere than before: the leg moved, or the arm lost steps."""
    DEADLINE = "deadline"
    """A state lasted longer than it may."""
    LEASE_LOST = "lease_lost"
    """The client whose lease asked for it fell silent. The arm pauses, without a fault."""
    DISK = "disk"
    """The disk does not take the record."""
    INTERRUPTED = "interrupted"
    """The daemon ended with a session open: a crash, a kill, a power cut."""
    INTERNAL = "internal"
    """An error that nobody foresaw: a bug."""


class DeviceError(Exception):
    """A device did not do what was asked: cause, what happened, and what to do about it."""

    def __init__(self, cause: Cause, text: str, hint: str = "") -> None:
        self.cause = cause
        self.text = text
        self.hint = hint
        super().__init__(f"{cause}: {text}" + (f" ({hint})" if hint else ""))
