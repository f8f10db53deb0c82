"""Rays against the frustum."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, project, undistort
from legato.geometry.raycast import (
    BIG_FACE,
    MISS,
    SIDE,
    SMALL_FACE,
    cast,
    facing,
    object_rays,
    points_on,
)
from legato.geometry.transforms import invert, look_at

LEG = Leg()


def _aimed_rays(seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from a shell around the leg toward places near it."""
    rng = np.random.default_rng(seed)
    way = rng.normal(size=(count, 3))
    origins = [97.0, 0.0, 0.0] + 260.0 * way / np.linalg.norm(way, axis=1, keepdims=True)
    targets = rng.uniform([-20.0, -35.0, -35.0], [215.0, 35.0, 35.0], size=(count, 3))
    return origins, targets - origins


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_hits_lie_on_the_surface_and_are_the_first(seed: int) -> None:
    """A hit has no clearance, and nowhere before it is the ray inside the leg."""
    origins, directions = _aimed_rays(seed, 300)
    hits = cast(LEG, origins, directions)
    assert np.abs(LEG.clearance(hits.points[hits.hit])).max() < 1e-9
    reach = np.where(hits.hit, hits.distance, 3.0)
    along = np.linspace(0.0, 0.999, 200) * reach[:, None]
    before = origins[:, None] + along[..., None] * directions[:, None]
    assert LEG.clearance(before).min() > -1e-9


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_normals_point_outward_and_against_the_ray(seed: int) -> None:
    """A step along the normal gains just that clearance, and the ray comes from that side."""
    origins, directions = _aimed_rays(seed, 300)
    hits = cast(LEG, origins, directions)
    points, normals = hits.points[hits.hit], hits.normals[hits.hit]
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert np.allclose(LEG.clearance(points + 0.5 * normals), 0.5, atol=1e-6)
    assert ((normals * directions[hits.hit]).sum(axis=1) < 0.0).all()


def test_parts_are_named() -> None:
    """Each face, the side and a miss are told apart."""
    origins = [[-50.0, 3.0, 0.0], [250.0, 1.0, 0.0], [90.0, -99.0, 0.0], [90.0, -99.0, 90.0]]
    directions = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
    hits = cast(LEG, origins, directions)
    assert hits.part.tolist() == [BIG_FACE, SMALL_FACE, SIDE, MISS]
    assert np.isnan(hits.points[3]).all()
    assert hits.points[2] == pytest.approx([90.0, -LEG.radius(90.0), 0.0])


def test_ray_along_a_generator_is_no_trouble() -> None:
    """A ray for which the quadratic loses its first term still gives its one meeting."""
    step = np.array([1.0, 0.0, -LEG.slope])
    inside = LEG.surface_point(60.0) - [0.0, 0.0, 4.0]
    hits = cast(LEG, inside - 100.0 * step, step)
    assert bool(hits.hit)
    assert abs(float(LEG.clearance(hits.points))) < 1e-9


def test_pixels_rays_meet_what_is_projected_there() -> None:
    """Casting the ray of a surface point's pixel gives the point back, distortion included."""
    camera = Intrinsics(652.0, 655.0, 346.0, 279.0, k1=-0.1, k2=0.02)
    pose = invert(look_at([60.0, -160.0, 90.0], [80.0, 0.0, 0.0]))
    angles = np.radians(np.linspace(20.0, 100.0, 9))
    points = LEG.surface_point(np.linspace(10.0, 180.0, 9), angles)
    pixels = project(camera, pose, points)
    hits = cast(LEG, *object_rays(pose, undistort(camera, pixels)))
    assert np.allclose(hits.points, points, atol=1e-6)


def test_facing_agrees_with_casting() -> None:
    """A mark faces the camera exactly where a ray from the camera meets it first."""
    rng = np.random.default_rng(4)
    for _ in range(60):
        way = rng.normal(size=3)
        eye = np.array([97.0, 0.0, 0.0]) + 300.0 * way / np.linalg.norm(way)
        pose = invert(look_at(eye, [97.0, 0.0, 0.0]))
        for name, centre in LEG.marks.items():
            cosine = facing(LEG, name, pose)
            if abs(cosine) > 0.02:
                hits = cast(LEG, eye, np.asarray(centre) - eye)
                assert (abs(float(hits.distance) - 1.0) < 1e-4) == (cosine > 0.0)


def test_points_on_a_part_are_those_that_rays_meet_first() -> None:
    """On a part that faces the rays' origin, asking for it alone gives what casting gives."""
    rng = np.random.default_rng(5)
    origin = np.array([-60.0, -120.0, 40.0])
    targets = rng.uniform([0.0, -30.0, -30.0], [194.0, 30.0, 30.0], (400, 3))
    hits = cast(LEG, origin, targets - origin)
    for part in (SIDE, BIG_FACE):
        own = hits.part == part
        assert own.sum() > 10
        points = points_on(LEG, part, origin, targets - origin)
        assert np.allclose(points[own], hits.points[own], atol=1e-9)
    miss = points_on(LEG, SIDE, origin, np.array([[0.0, -1.0, 0.0]]))
    assert np.isnan(miss).all()
