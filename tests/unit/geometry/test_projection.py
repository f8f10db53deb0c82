"""The camera model: projection, distortion and their inverses."""

import cv2
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from legato.geometry.leg import Leg
from legato.geometry.projection import (
    Intrinsics,
    distort,
    pinhole_pixels,
    project,
    rays,
    undistort,
)
from legato.geometry.transforms import Array, invert, look_at, rotation_from_angles, transform

CAMERA = Intrinsics(652.0, 655.0, 346.0, 279.0, -0.08, 0.03)
pixels = npst.arrays(float, (5, 2), elements=st.floats(0.0, 575.0))


def test_projection_is_opencvs() -> None:
    """The same points land on the same pixels as cv2.projectPoints puts them."""
    world_from_object = transform(rotation_from_angles([0.1, -0.1, 1.5]), [124.0, -64.0, 30.0])
    pose = invert(look_at([228.6, -101.6, 50.8], [126.0, -4.0, 36.0])) @ world_from_object
    points = Leg().points()
    seen, _ = cv2.projectPoints(
        points, cv2.Rodrigues(pose[:3, :3])[0], pose[:3, 3], CAMERA.matrix(),
        np.array([CAMERA.k1, CAMERA.k2, 0.0, 0.0]),
    )  # fmt: skip
    assert np.allclose(project(CAMERA, pose, points), seen[:, 0], atol=1e-9)


@given(p=pixels)
def test_undistortion_undoes_distortion(p: Array) -> None:
    """Pixels go to normalised coordinates and back."""
    assert np.allclose(distort(CAMERA, undistort(CAMERA, p)), p, atol=1e-7)


@given(p=pixels)
def test_a_ray_hits_the_pixel_it_came_from(p: Array) -> None:
    """Points along the rays project to their pixels."""
    assert np.allclose(project(CAMERA, np.eye(4), 150.0 * rays(CAMERA, p)), p, atol=1e-7)


@given(p=pixels)
def test_pinhole_pixels_belong_to_the_same_ray(p: Array) -> None:
    """What a lens without distortion would show of the same rays."""
    plain = Intrinsics(652.0, 655.0, 346.0, 279.0)
    assert np.allclose(rays(plain, pinhole_pixels(CAMERA, p)), rays(CAMERA, p), atol=1e-10)


def test_points_behind_the_camera_have_no_pixel() -> None:
    """The formula alone would accept them; here they are not a number."""
    both = np.array([[0.0, 0.0, 100.0], [0.0, 0.0, -100.0]])
    seen = project(CAMERA, np.eye(4), both)
    assert np.isfinite(seen[0]).all()
    assert np.isnan(seen[1]).all()
