"""Where pictures come from: picture files, a film, a device or a stream.

A source is used by one thread. Times are `time.monotonic` seconds.
"""

import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np

from legato.drivers.opencv.settings import CameraSettings, lost
from legato.hal.camera import Image

PICTURES = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp"}
FIRST_NUMBERS = 1000  # a %d pattern's first number is below this


class Capture(Protocol):
    """What the driver uses of `cv2.VideoCapture`."""

    def isOpened(self) -> bool: ...  # noqa: D102 - OpenCV's name
    def grab(self) -> bool: ...  # noqa: D102 - OpenCV's
    def retrieve(self) -> tuple[bool, Any]: ...  # noqa: D102 - OpenCV's
    def get(self, propId: int) -> float: ...  # noqa: D102 - OpenCV's name
    def set(self, propId: int, value: float) -> bool: ...  # noqa: D102 - OpenCV's name
    def getBackendName(self) -> str: ...  # noqa: D102 - OpenCV's name
    def release(self) -> None: ...  # noqa: D102 - OpenCV's


OpenCapture = Callable[[str | int], Capture]


def open_capture(source: str | int) -> Capture:
    """Open a source with the back end that OpenCV finds for it."""
    if isinstance(source, int):
        return cv2.VideoCapture(source)
    return cv2.VideoCapture(source)


class Source(Protocol):
    """Where pictures come from: `grab` goes to the next, `retrieve` decodes it."""

    live: bool

    def grab(self) -> float:
        """Go to the next picture; return when it was taken, in `time.monotonic` seconds."""

    def retrieve(self) -> Image:
        """Return the picture that was grabbed."""

    def release(self) -> None:
        """Let go of the device or file."""


class Pictures:
    """Picture files in turn."""

    live = False

    def __init__(self, files: list[Path]) -> None:
        self._files = files
        self._next = 0
        self._file = files[0]

    def grab(self) -> float:
        """Go to the next file; after the last comes the first."""
        self._file = self._files[self._next % len(self._files)]
        self._next += 1
        return time.monotonic()

    def retrieve(self) -> Image:
        """Read the file."""
        return _eight_bit(cv2.imread(str(self._file), cv2.IMREAD_ANYCOLOR), str(self._file))

    def release(self) -> None:
        """Do nothing: no file stays open."""


class Film:
    """A film file, frame by frame."""

    live = False

    def __init__(self, source: str, open_capture: OpenCapture) -> None:
        self._source = source
        self._open_capture = open_capture
        self._capture = _opened(source, open_capture)

    def grab(self) -> float:
        """Go to the next frame; after the last comes the first."""
        if not self._capture.grab():
            self._capture.release()
            self._capture = _opened(self._source, self._open_capture)
            if not self._capture.grab():
                raise lost(f"{self._source} has no frame that can be read")
        return time.monotonic()

    def retrieve(self) -> Image:
        """Decode the frame."""
        return _eight_bit(self._capture.retrieve()[1], self._source)

    def release(self) -> None:
        """Close the film."""
        self._capture.release()


class Live:
    """A device or a stream."""

    live = True

    def __init__(self, settings: CameraSettings, source: str | int, open_capture: OpenCapture):
        self._name = f"camera {source}"
        self._capture = _opened(source, open_capture)
        self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        if isinstance(source, int) or source.startswith("/dev/"):
            self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width)
            self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height)
        # Only this back end's time stamps are known to be those of the monotonic clock.
        self._stamped = self._capture.getBackendName() == "V4L2"

    def grab(self) -> float:
        """Wait for the next picture; without stamps it was taken no earlier than this call."""
        began = time.monotonic()
        if not self._capture.grab():
            raise lost(f"{self._name} gives no more pictures")
        stamp = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0 if self._stamped else 0.0
        return stamp if 0.0 < stamp <= time.monotonic() else began

    def retrieve(self) -> Image:
        """Decode the picture."""
        return _eight_bit(self._capture.retrieve()[1], self._name)

    def release(self) -> None:
        """Close the device."""
        self._capture.release()


def find_source(settings: CameraSettings, open_capture: OpenCapture) -> Source:
    """Open what the configuration names. Raises DeviceError (camera_lost)."""
    source = settings.source
    if isinstance(source, str) and source.isdecimal():
        source = int(source)
    if isinstance(source, int) or source.startswith("/dev/") or "://" in source:
        return Live(settings, source, open_capture)
    if "%" in source:
        return Pictures(_numbered(source))
    if not Path(source).is_file():
        raise lost(f"there is no file {source}")
    if Path(source).suffix.lower() in PICTURES:
        return Pictures([Path(source)])
    return Film(source, open_capture)


def _opened(source: str | int, open_capture: OpenCapture) -> Capture:
    """Return an opened capture. Raises DeviceError."""
    capture = open_capture(source)
    if not capture.isOpened():
        capture.release()
        raise lost(f"OpenCV cannot open {source}")
    return capture


def _numbered(pattern: str) -> list[Path]:
    """Return the files of a %02d pattern, from the first number that exists to the first gap."""
    try:
        first = next((n for n in range(FIRST_NUMBERS) if Path(pattern % n).is_file()), None)
    except (TypeError, ValueError) as error:
        raise lost(f"{pattern} is no pattern for one number: {error}") from error
    if first is None:
        raise lost(f"no file fits {pattern}, from {pattern % 0} on")
    files = []
    for n in count(first):
        file = Path(pattern % n)
        if not file.is_file():
            break
        files.append(file)
    return files


def _eight_bit(image: Any, name: str) -> Image:
    """Return a picture (H, W) or (H, W, 3) of 8 bits. Raises DeviceError."""
    if image is None or image.dtype != np.uint8 or image.ndim not in (2, 3):
        raise lost(f"{name} holds no picture that OpenCV can read as 8 bits")
    return np.asarray(image, dtype=np.uint8)
