"""A camera as the daemon sees it: a grab gives one picture taken after the call."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Frame:
    """One picture: (H, W) grey or (H, W, 3) BGR, 8 bit; its age in s when it was handed over."""

    image: Image
    age_s: float
    sequence: int
    source: str


@runtime_checkable
class Camera(Protocol):
    """One camera. Every call ends within a time-out or raises DeviceError."""

    @property
    def simulated(self) -> bool:
        """Whether pictures come from a simulation."""

    def open(self) -> None:
        """Connect and see that a picture of the configured size arrives."""

    def close(self) -> None:
        """Let go of the device in any state."""

    def grab(self) -> Frame:
        """Return a picture taken after this call; camera_stale where only an older one is there."""
