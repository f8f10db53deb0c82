"""The OpenCV camera's settings and errors."""

from typing import Annotated

from msgspec import Meta, Struct

from legato.hal.faults import Cause, DeviceError


class CameraSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The camera; names are the configuration's keys.

    `source` is a device's index or path, a URL, a picture, a film, or a %02d pattern of pictures.
    """

    source: str | int
    width: Annotated[int, Meta(gt=0)] = 768
    height: Annotated[int, Meta(gt=0)] = 576
    timeout_s: Annotated[float, Meta(gt=0)] = 3.0
    max_age_s: Annotated[float, Meta(gt=0)] = 1.0


def lost(text: str) -> DeviceError:
    """Return the error of a camera that gives nothing."""
    return DeviceError(Cause.CAMERA_LOST, text, "see that camera.source is right and plugged in")


def stale(text: str) -> DeviceError:
    """Return the error of a camera that gives old pictures only."""
    return DeviceError(Cause.CAMERA_STALE, text, "see why the camera or its line is so slow")
