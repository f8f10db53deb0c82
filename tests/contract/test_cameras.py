"""What every camera driver promises, held by the simulated camera and by OpenCV's over files."""

from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from legato.drivers.faulty.camera import FaultyCamera
from legato.drivers.opencv import CameraSettings, OpenCVCamera
from legato.drivers.sim.camera import SimCamera
from legato.drivers.sim.clock import ManualClock
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import World
from legato.geometry.arm import ArmModel
from legato.geometry.leg import Leg
from legato.geometry.transforms import transform
from legato.hal.camera import Camera
from legato.hal.faults import Cause, DeviceError

WIDTH, HEIGHT = 192, 144


def sim_world(seed: int = 1) -> World:
    """Return a small camera's world."""
    true = SimSettings(seed=seed, alpha_u=163.0, alpha_v=164.0, u0=86.0, v0=70.0)
    return World(true, Leg(), ArmModel(), ManualClock())


def simulated(_: Path) -> Camera:
    """Make the simulated camera."""
    return SimCamera(sim_world(), WIDTH, HEIGHT)


def wrapped(_: Path) -> Camera:
    """Wrap the simulated camera in one that could go wrong, and does not."""
    world = sim_world()
    return FaultyCamera(SimCamera(world, WIDTH, HEIGHT), (), world.clock)


def from_files(folder: Path) -> Camera:
    """Make OpenCV's driver over numbered files."""
    rng = np.random.default_rng(1)
    for n in range(3):
        picture = rng.integers(0, 256, (HEIGHT, WIDTH), np.uint8)
        cv2.imwrite(str(folder / f"{n:02d}.png"), picture)
    source = str(folder / "%02d.png")
    return OpenCVCamera(CameraSettings(source=source, width=WIDTH, height=HEIGHT))


@pytest.fixture(params=[simulated, wrapped, from_files])
def camera(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Camera]:
    """Each driver in turn, not opened yet."""
    make: Callable[[Path], Camera] = request.param
    made = make(tmp_path)
    yield made
    made.close()


def test_it_is_a_camera_that_says_whether_it_is_real(camera: Camera) -> None:
    """It has every member of the protocol."""
    assert isinstance(camera, Camera)
    assert camera.simulated is isinstance(camera, SimCamera | FaultyCamera)


def test_nothing_comes_before_open_and_after_close(camera: Camera) -> None:
    """A grab from a camera that is not open is camera_lost."""
    for _ in range(2):
        with pytest.raises(DeviceError) as caught:
            camera.grab()
        assert caught.value.cause is Cause.CAMERA_LOST
        camera.open()
        camera.close()


def test_open_and_close_are_idempotent(camera: Camera) -> None:
    """Twice is as good as once."""
    camera.open()
    camera.open()
    camera.grab()
    camera.close()
    camera.close()
    camera.open()
    camera.grab()


def test_frames_are_8_bit_of_the_configured_size_and_numbered(camera: Camera) -> None:
    """Each frame has a new number, a small age, a source, and a picture of its own."""
    camera.open()
    frames = [camera.grab() for _ in range(3)]
    assert [f.sequence for f in frames] == [1, 2, 3]
    for frame in frames:
        assert frame.image.shape[:2] == (HEIGHT, WIDTH)
        assert frame.image.dtype == np.uint8
        assert 0.0 <= frame.age_s < 1.0
        assert frame.source
    kept = frames[0].image.copy()
    camera.grab()
    assert (frames[0].image == kept).all()
    assert (frames[0].image != frames[1].image).any()


def test_the_simulated_camera_sees_the_leg_that_the_world_holds() -> None:
    """Noise is new each time and small; a leg that was moved is seen to have moved."""
    world = sim_world()
    camera = SimCamera(world, WIDTH, HEIGHT)
    camera.open()
    began = world.clock.monotonic()
    first, second = (camera.grab().image.astype(float) for _ in range(2))
    assert world.clock.monotonic() - began == pytest.approx(2 * world.settings.picture_s)
    noise = second - first
    assert 1.0 < noise.std() < 5.0
    shift = transform(np.eye(3), [0.0, 10.0, 0.0])
    world.place_leg(shift @ world.world_from_object)
    moved = camera.grab().image.astype(float) - first
    assert moved.std() > 2.0 * noise.std()


def test_the_same_seed_gives_the_same_pictures() -> None:
    """Pose, marks and noise are drawn from the seed alone."""
    images = []
    for seed in (3, 3, 4):
        camera = SimCamera(sim_world(seed), WIDTH, HEIGHT)
        camera.open()
        images.append(camera.grab().image)
    assert (images[0] == images[1]).all()
    assert (images[0] != images[2]).any()
