"""The thread that reads a source, so that a camera which hangs never blocks the daemon.

A live source is read all the time, so that no old picture waits in a buffer; a picture counts
only if its taking began after it was asked for.
"""

import threading
import time
from collections.abc import Callable

import cv2

from legato.drivers.opencv.settings import lost, stale
from legato.drivers.opencv.sources import Source
from legato.hal.camera import Image
from legato.hal.faults import DeviceError

CLOSE_S = 1.0


class Feed:
    """The thread that reads a source, and the one picture that it was asked for."""

    def __init__(self, find: Callable[[], Source], name: str) -> None:
        self._find = find
        self._changed = threading.Condition()
        self._wanted: float | None = None
        self._passed: list[float] = []
        self._picture: tuple[Image, float | None] | None = None
        self._error: DeviceError | None = None
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name=f"camera {name}", daemon=True)
        self._thread.start()

    @property
    def failed(self) -> bool:
        """Whether the source has failed; it then gives nothing more."""
        return self._error is not None

    def next(self, timeout_s: float) -> tuple[Image, float | None]:
        """Return a picture taken from now on, and when (None from files). Raises DeviceError."""
        with self._changed:
            self._picture = None
            self._passed.clear()
            self._wanted = asked = time.monotonic()
            self._changed.notify_all()
            self._changed.wait_for(self._answered, timeout_s)
            self._wanted = None
            if self._error is not None:
                raise self._error
            return self._picture_for(asked, timeout_s)

    def _answered(self) -> bool:
        """Say whether there is a picture or an error to hand over."""
        return self._picture is not None or self._error is not None

    def _picture_for(self, asked: float, timeout_s: float) -> tuple[Image, float | None]:
        """Return the picture that came. Raises DeviceError where none did, or only old ones."""
        if self._picture is not None:
            return self._picture
        # The one picture that was under way at the call is no sign that more are to come.
        if len(self._passed) > 1:
            before = asked - self._passed[-1]
            raise stale(f"the newest picture was taken {before:.2f} s before the call")
        raise lost(f"no picture within {timeout_s:g} s")

    def stop(self) -> None:
        """End the thread, or leave it behind where the source hangs; it lets go of it later."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        self._thread.join(CLOSE_S)

    def _run(self) -> None:
        """Read until told to stop; keep what went wrong for the one who asks."""
        try:
            source = self._find()
            try:
                while self._awaited(source.live):
                    self._take(source)
            finally:
                source.release()
        except DeviceError as error:
            self._fail(error)
        except (cv2.error, OSError) as error:
            self._fail(lost(f"OpenCV: {error}"))

    def _awaited(self, live: bool) -> bool:
        """Wait, with files, until a picture is asked for; say whether to go on."""
        with self._changed:
            if not live:
                self._changed.wait_for(lambda: self._stopping or self._wanted is not None)
            return not self._stopping

    def _take(self, source: Source) -> None:
        """Go to the next picture, and hand it over if it was asked for and is new enough."""
        taken = source.grab()
        with self._changed:
            if not self._wanted_at(taken):
                if self._wanted is not None:
                    self._passed.append(taken)
                return
        image = source.retrieve()
        with self._changed:
            if not self._wanted_at(taken):
                return  # whoever asked has given up, and perhaps asked again
            self._wanted = None
            self._picture = image, taken if source.live else None
            self._changed.notify_all()

    def _wanted_at(self, taken: float) -> bool:
        """Say whether a picture taken at a time answers what was asked."""
        return self._wanted is not None and taken >= self._wanted

    def _fail(self, error: DeviceError) -> None:
        """Keep an error and wake the one who waits."""
        with self._changed:
            self._error = error
            self._changed.notify_all()
