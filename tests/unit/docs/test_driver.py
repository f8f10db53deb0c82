"""The drivers of "Add a driver", as printed, held to the contract of those that ship."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from legato.drivers.sim.clock import ManualClock
from legato.hal.camera import Camera
from legato.hal.faults import Cause, DeviceError
from tests.contract import arms
from tests.contract import test_arms as promises
from tests.contract import test_cameras as cameras
from tests.printed import DOCS, blocks

PAGE = DOCS / "howto" / "driver.md"


def printed(name: str) -> Any:
    """Return a class or function that the page defines; all its code is run as one module."""
    module: dict[str, Any] = {
        "__name__": "printed", "cv2": cv2, "np": np, "Camera": Camera,
        "WIDTH": cameras.WIDTH, "HEIGHT": cameras.HEIGHT,
    }  # fmt: skip
    for block in blocks(PAGE):
        if block.kind == "python":
            exec(compile(block.text, block.caption, "exec"), module)
    return module[name]


@pytest.fixture
def camera(tmp_path: Path) -> Iterator[Camera]:
    """Return the page's camera, made by the page's maker."""
    made: Camera = printed("from_folder")(tmp_path)
    yield made
    made.close()


@pytest.fixture
def bench() -> arms.Bench:
    """Return the page's arm, beside a world that it does not touch."""
    return arms.Bench(printed("CountingArm")(ManualClock()), arms.still_world())


@pytest.mark.parametrize(
    "promise",
    [
        cameras.test_it_is_a_camera_that_says_whether_it_is_real,
        cameras.test_nothing_comes_before_open_and_after_close,
        cameras.test_open_and_close_are_idempotent,
    ],
)
def test_the_printed_camera_keeps_a_cameras_promises(promise: Any, camera: Camera) -> None:
    """The very tests that the drivers that ship are held to."""
    promise(camera)


def test_the_printed_camera_gives_the_newest_picture(tmp_path: Path, camera: Camera) -> None:
    """It is numbered, of the configured size; another size or none is camera_lost."""
    camera.open()
    assert camera.grab().sequence == 1
    assert camera.grab().image.shape[:2] == (cameras.HEIGHT, cameras.WIDTH)
    cv2.imwrite(str(tmp_path / "2.png"), np.zeros((10, 10), np.uint8))
    with pytest.raises(DeviceError) as caught:
        camera.grab()
    assert caught.value.cause is Cause.CAMERA_LOST


@pytest.mark.parametrize(
    "promise",
    [
        promises.test_nothing_works_before_open_and_after_close,
        promises.test_open_and_close_are_idempotent_and_move_nothing,
        promises.test_a_step_returns_the_reading_after_the_motion,
        promises.test_a_step_of_nothing_is_harmless,
    ],
)
def test_the_printed_arm_keeps_an_arms_promises(promise: Any, bench: arms.Bench) -> None:
    """Those that need no leg to touch."""
    promise(bench)


def test_the_printed_arm_zeroes_where_it_stands(bench: arms.Bench) -> None:
    """Registers begin anew."""
    bench.arm.open()
    bench.arm.step(arms.MOVE)
    bench.arm.zero()
    assert bench.arm.read().registers == arms.ZERO
