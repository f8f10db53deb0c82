"""Camera trouble that may pass: asked again after a while, longer each time, but not for ever.

Only the camera is asked again. What the arm has not done is never tried a second time.
"""

from typing import Any, Final

from legato.control.states import CAPTURE, DEADLINES
from legato.hal.faults import Cause, DeviceError

PASSING: Final = (Cause.CAMERA_LOST, Cause.CAMERA_STALE)
FIRST_S: Final = 0.25
# Half the shorter deadline of the two states that take pictures: the rest is for the last try.
LIMIT_S: Final = DEADLINES[CAPTURE] / 2


class Patience:
    """The pauses between the tries for one picture; times are s of any clock that runs on."""

    def __init__(self, *began: float) -> None:
        self._began = began
        self._pause = FIRST_S
        self.tries = 1

    def pause(self, error: DeviceError, *now: float) -> float:
        """Return how long to wait before the next try; raises the error where it may not be.

        `now` are the times of the clocks that `began` was told of.
        """
        lasted = max(n - b for n, b in zip(now, self._began, strict=True))
        if error.cause not in PASSING or lasted + self._pause > LIMIT_S:
            raise error
        pause, self._pause = self._pause, 2.0 * self._pause
        self.tries += 1
        return pause

    def told(self, error: DeviceError, pause: float) -> dict[str, Any]:
        """Return the progress event of a try that has failed."""
        text = f"no picture, {error.cause}: {error.text}; try {self.tries} in {pause:g} s"
        retry = {"cause": str(error.cause), "try": self.tries, "pause_s": pause}
        return {"text": text, "station_mm": None, "stroke": None, "retry": retry}
