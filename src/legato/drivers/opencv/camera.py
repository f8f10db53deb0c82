"""The camera driver over OpenCV: pictures of the configured size, taken after the call."""

import time

from legato.drivers.opencv.feed import Feed
from legato.drivers.opencv.settings import CameraSettings, lost, stale
from legato.drivers.opencv.sources import OpenCapture, find_source, open_capture
from legato.hal.camera import Frame, Image
from legato.hal.faults import Cause, DeviceError


class OpenCVCamera:
    """A camera that OpenCV can open; every call ends within `timeout_s`."""

    def __init__(
        self,
        settings: CameraSettings,
        capture: OpenCapture = open_capture,
    ) -> None:
        self._settings = settings
        self._capture = capture
        self._feed: Feed | None = None
        self._first: tuple[Image, float | None] | None = None
        self._sequence = 0

    @property
    def simulated(self) -> bool:
        """False: pictures come from a device or from files."""
        return False

    def open(self) -> None:
        """Start reading, and see that a picture of the configured size arrives."""
        if self._feed is not None and not self._feed.failed:
            return
        self.close()
        settings, capture = self._settings, self._capture
        self._feed = Feed(lambda: find_source(settings, capture), str(settings.source))
        try:
            image, taken = self._next()
        except DeviceError:
            self.close()
            raise
        # A file's first picture is the first that is handed over; a live one would be old by then.
        self._first = None if taken is not None else (image, taken)

    def close(self) -> None:
        """Let go of the source in any state."""
        feed, self._feed, self._first = self._feed, None, None
        if feed is not None:
            feed.stop()

    def grab(self) -> Frame:
        """Return a picture taken after this call. Raises DeviceError: camera_lost, camera_stale."""
        first, self._first = self._first, None
        image, taken = first if first is not None else self._next()
        age = 0.0 if taken is None else time.monotonic() - taken
        if age > self._settings.max_age_s:
            limit = self._settings.max_age_s
            raise stale(f"the picture was {age:.2f} s old when it came, more than {limit:g} s")
        self._sequence += 1
        return Frame(image, age, self._sequence, str(self._settings.source))

    def _next(self) -> tuple[Image, float | None]:
        """Return the next picture, of the right size. Raises DeviceError."""
        if self._feed is None:
            raise lost("the camera is not open")
        image, taken = self._feed.next(self._settings.timeout_s)
        height, width = image.shape[:2]
        if (width, height) != (self._settings.width, self._settings.height):
            raise DeviceError(
                Cause.CAMERA_LOST,
                f"{self._settings.source} gives pictures of {width}x{height} px, the configuration "
                f"says {self._settings.width}x{self._settings.height}",
                "set camera.width and camera.height to what it gives; intrinsics hold for one size",
            )
        return image, taken
