"""The OpenCV camera: files in turn, live pictures that are new, and no call that hangs."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from legato.drivers.opencv import CameraSettings, OpenCVCamera
from legato.hal.faults import Cause, DeviceError

SIZE = (32, 24)


class FakeCapture:
    """A device whose frames are handed out by the test; each is filled with its own number."""

    def __init__(self, *, stamps: list[float] | None = None, pace: float = 0.002) -> None:
        self.count = 0
        self.pace = pace
        self.stamps = stamps
        self.failing = threading.Event()
        self.hanging = threading.Event()
        self.go_on = threading.Event()
        self.released = threading.Event()
        self.wanted: dict[int, float] = {}

    def isOpened(self) -> bool:
        """Say yes."""
        return True

    def grab(self) -> bool:
        """Give a frame after the device's pace, hang, or fail."""
        if self.hanging.is_set():
            self.go_on.wait(10.0)
        time.sleep(self.pace)
        self.count += 1
        return not self.failing.is_set()

    def retrieve(self) -> tuple[bool, Any]:
        """Return a picture that shows its number."""
        return True, np.full((SIZE[1], SIZE[0], 3), self.count % 256, np.uint8)

    def get(self, propId: int) -> float:
        """Return the frame's time stamp in ms."""
        assert propId == cv2.CAP_PROP_POS_MSEC
        assert self.stamps is not None
        return 1000.0 * (self.stamps.pop(0) if self.stamps else time.monotonic())

    def set(self, propId: int, value: float) -> bool:
        """Remember what was asked for."""
        self.wanted[propId] = value
        return True

    def getBackendName(self) -> str:
        """Return whose stamps are given."""
        return "V4L2" if self.stamps is not None else "FFMPEG"

    def release(self) -> None:
        """Note it."""
        self.released.set()


def live(capture: FakeCapture, **settings: Any) -> OpenCVCamera:
    """Return a camera over a fake device."""
    fields: dict[str, Any] = {"source": 0, "width": SIZE[0], "height": SIZE[1], **settings}
    return OpenCVCamera(CameraSettings(**fields), lambda _: capture)


def from_files(source: Path, **settings: Any) -> OpenCVCamera:
    """Return a camera over files."""
    fields: dict[str, Any] = {"width": SIZE[0], "height": SIZE[1], **settings}
    return OpenCVCamera(CameraSettings(source=str(source), **fields))


def grey(value: int, size: tuple[int, int] = SIZE) -> Any:
    """Return a picture of one grey level."""
    return np.full((size[1], size[0]), value, np.uint8)


@pytest.fixture(autouse=True)
def no_threads_left() -> Iterator[None]:
    """Every test ends with the threads it began with."""
    before = set(threading.enumerate())
    yield
    for thread in set(threading.enumerate()) - before:
        thread.join(2.0)
        assert not thread.is_alive(), thread


def test_a_pattern_gives_its_files_in_turn_and_begins_again(tmp_path: Path) -> None:
    """From the first number that exists to the first gap, then again; opening uses none."""
    for n in (3, 4, 5, 7):
        cv2.imwrite(str(tmp_path / f"view-{n:02d}.png"), grey(10 * n))
    camera = from_files(tmp_path / "view-%02d.png")
    camera.open()
    frames = [camera.grab() for _ in range(5)]
    camera.close()
    assert [int(f.image[0, 0]) for f in frames] == [30, 40, 50, 30, 40]
    assert [f.sequence for f in frames] == [1, 2, 3, 4, 5]
    assert all(f.age_s == 0.0 for f in frames)


def test_one_picture_is_given_again_and_again(tmp_path: Path) -> None:
    """A single file never ends; colour comes as BGR."""
    file = tmp_path / "leg.png"
    cv2.imwrite(str(file), np.full((SIZE[1], SIZE[0], 3), (1, 2, 3), np.uint8))
    camera = from_files(file)
    camera.open()
    assert [camera.grab().image[0, 0].tolist() for _ in range(3)] == [[1, 2, 3]] * 3
    camera.close()


def test_a_film_begins_again_at_its_end(tmp_path: Path) -> None:
    """Frames in order, then the first once more."""
    file = str(tmp_path / "film.avi")
    writer = cv2.VideoWriter(file, cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (64, 48))
    for value in (20, 120, 220):
        writer.write(np.full((48, 64, 3), value, np.uint8))
    writer.release()
    camera = from_files(Path(file), width=64, height=48)
    camera.open()
    seen = [int(camera.grab().image.mean()) for _ in range(5)]
    camera.close()
    assert seen == pytest.approx([20, 120, 220, 20, 120], abs=6)


def test_a_picture_of_another_size_is_refused_with_both_sizes(tmp_path: Path) -> None:
    """Intrinsics hold for one size; the error names what came and what was configured."""
    file = tmp_path / "small.png"
    cv2.imwrite(str(file), grey(0, (16, 12)))
    with pytest.raises(DeviceError, match="16x12 px, the configuration says 32x24") as caught:
        from_files(file).open()
    assert caught.value.cause is Cause.CAMERA_LOST


@pytest.mark.parametrize("name", ["missing.png", "missing-%02d.png", "bad-%q.png", "missing.avi"])
def test_what_is_not_there_is_lost_and_named(tmp_path: Path, name: str) -> None:
    """A missing file, pattern or film says which."""
    with pytest.raises(DeviceError, match=name.split(".")[0]) as caught:
        from_files(tmp_path / name).open()
    assert caught.value.cause is Cause.CAMERA_LOST


@pytest.mark.parametrize("content", [b"", b"no picture at all", b"\x89PNG\r\n\x1a\n\x00\x00"])
def test_files_that_are_no_pictures_are_lost(tmp_path: Path, content: bytes) -> None:
    """Empty, foreign and torn files give a clear error."""
    file = tmp_path / "torn.png"
    file.write_bytes(content)
    with pytest.raises(DeviceError, match=r"torn\.png holds no picture"):
        from_files(file).open()


def test_sixteen_bit_and_alpha_become_eight_bit(tmp_path: Path) -> None:
    """Deep and transparent PNGs come out as 8-bit grey or BGR."""
    file = tmp_path / "deep.png"
    cv2.imwrite(str(file), np.full((SIZE[1], SIZE[0]), 0x4000, np.uint16))
    camera = from_files(file)
    camera.open()
    image = camera.grab().image
    camera.close()
    assert image.dtype == np.uint8
    assert int(image.flat[0]) == pytest.approx(0x40, abs=1)
    cv2.imwrite(str(file), np.full((SIZE[1], SIZE[0], 4), 99, np.uint8))
    camera.open()
    assert camera.grab().image.shape == (SIZE[1], SIZE[0], 3)
    camera.close()


def test_a_live_picture_was_begun_after_the_call() -> None:
    """Between two grabs the device runs on, and the second shows a frame begun after its call."""
    capture = FakeCapture()
    camera = live(capture)
    camera.open()
    for _ in range(5):
        begun = capture.count
        frame = camera.grab()
        # The frame that was being taken at the call has number begun + 1.
        assert int(frame.image[0, 0, 0]) >= (begun + 2) % 256
        assert 0.0 <= frame.age_s < 1.0
    camera.close()
    assert capture.released.is_set()
    assert capture.wanted[cv2.CAP_PROP_FRAME_WIDTH] == SIZE[0]


def test_old_frames_in_a_buffer_are_passed_over() -> None:
    """Kernel time stamps decide: frames from before the call are read and thrown away."""
    old = time.monotonic() - 20.0
    capture = FakeCapture(stamps=[old, old + 0.04, old + 0.08])
    camera = live(capture)
    camera.open()
    assert capture.count > 3
    assert camera.grab().age_s < 1.0
    camera.close()


def test_only_old_frames_are_stale() -> None:
    """A device that gives nothing but old pictures is camera_stale, not lost."""
    old = time.monotonic() - 20.0
    camera = live(FakeCapture(stamps=[old + 0.001 * n for n in range(10_000)]), timeout_s=0.05)
    with pytest.raises(DeviceError, match="before the call") as caught:
        camera.open()
    assert caught.value.cause is Cause.CAMERA_STALE


def test_a_picture_that_took_too_long_is_stale() -> None:
    """A frame older than max_age_s when it comes is refused."""
    camera = live(FakeCapture(pace=0.03), max_age_s=0.01)
    camera.open()
    with pytest.raises(DeviceError) as caught:
        camera.grab()
    camera.close()
    assert caught.value.cause is Cause.CAMERA_STALE


def test_a_device_that_hangs_is_lost_in_time() -> None:
    """Neither grab nor close waits for a read that never ends; the thread lets go later."""
    capture = FakeCapture()
    camera = live(capture, timeout_s=0.05)
    camera.open()
    capture.hanging.set()
    with pytest.raises(DeviceError, match=r"no picture within 0\.05 s") as caught:
        camera.grab()
    assert caught.value.cause is Cause.CAMERA_LOST
    capture.go_on.set()
    camera.close()
    assert capture.released.wait(2.0)


def test_an_unplugged_camera_is_lost_until_opened_again() -> None:
    """Every grab says lost; open starts anew once the device is back."""
    captures = [FakeCapture(), FakeCapture()]
    settings = CameraSettings(source=0, width=SIZE[0], height=SIZE[1])
    camera = OpenCVCamera(settings, lambda _: captures[0])
    camera.open()
    captures[0].failing.set()
    for _ in range(2):
        with pytest.raises(DeviceError, match="no more pictures"):
            camera.grab()
    captures.pop(0)
    camera.open()
    assert camera.grab().sequence == 1
    camera.close()


def test_an_index_in_words_and_a_url_are_live() -> None:
    """The text 2 is device 2, and a URL goes to OpenCV as it is, without a size forced on it."""
    asked: list[object] = []
    for source in ("2", "rtsp://127.0.0.1/leg"):
        capture = FakeCapture()
        settings = CameraSettings(source=source, width=SIZE[0], height=SIZE[1])

        def open_capture(name: str | int, capture: FakeCapture = capture) -> FakeCapture:
            asked.append(name)
            return capture

        camera = OpenCVCamera(settings, open_capture)
        camera.open()
        camera.close()
    assert asked == [2, "rtsp://127.0.0.1/leg"]
    assert cv2.CAP_PROP_FRAME_WIDTH not in capture.wanted


def test_a_device_that_opencv_cannot_open_is_lost() -> None:
    """A device number that does not exist is named."""

    class Closed(FakeCapture):
        def isOpened(self) -> bool:
            return False

    with pytest.raises(DeviceError, match="cannot open 0"):
        live(Closed()).open()
