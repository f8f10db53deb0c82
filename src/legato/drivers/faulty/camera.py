"""A camera that goes wrong on schedule: lost, stale, slow, or with pictures that show nothing."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

import numpy as np

from legato.drivers.faulty.script import Script
from legato.drivers.faulty.settings import FaultSettings
from legato.hal.camera import Camera, Frame, Image
from legato.hal.clock import Clock
from legato.hal.faults import Cause, DeviceError

GREY: Final = 128
DARK: Final = 0.02  # what is left of the light


class FaultyCamera:
    """A camera around another; without a fault that strikes it is that other."""

    def __init__(self, camera: Camera, faults: Iterable[FaultSettings], clock: Clock) -> None:
        self._camera = camera
        self._script = Script(faults, clock)

    @property
    def simulated(self) -> bool:
        """Whether pictures come from a simulation."""
        return self._camera.simulated

    def open(self) -> None:
        """Connect, unless a fault lasts that has taken the camera away."""
        for fault in self._script.struck_by("open"):
            self._begin(fault, opening=True)
        self._camera.open()

    def close(self) -> None:
        """Let go of the device."""
        self._camera.close()

    def grab(self) -> Frame:
        """Return a picture as the faults let it be seen."""
        struck = self._script.struck_by("grab")
        for fault in struck:
            self._begin(fault)
        frame = self._camera.grab()
        for fault in struck:
            frame = replace(frame, image=_seen(frame.image, fault.kind))
        return frame

    def _begin(self, fault: FaultSettings, *, opening: bool = False) -> None:
        """Wait, or raise what a driver would; a camera that is lost stays so until opened."""
        if fault.kind == "slow_grab":
            self._script.clock.sleep(fault.size)
        elif fault.kind == "camera_lost":
            self._camera.close()
            hint = "see that the camera is plugged in"
            raise DeviceError(Cause.CAMERA_LOST, "the camera gives no picture", hint)
        elif fault.kind == "camera_stale" and not opening:
            text = f"the camera's latest picture is {fault.size:g} s old"
            raise DeviceError(Cause.CAMERA_STALE, text, "see what keeps the camera")


def _seen(image: Image, kind: str) -> Image:
    """Return what is left of a picture."""
    if kind == "blank":
        return np.full_like(image, GREY)
    return (image * DARK).astype(np.uint8) if kind == "dark" else image
