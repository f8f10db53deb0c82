"""The simulated camera's pictures."""

import cv2
import numpy as np
import pytest

from legato.drivers.sim.render import INK, PAPER_WHITE, PastedMark, Renderer, paste_marks
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.surroundings import Light
from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, project, undistort
from legato.geometry.raycast import cast, object_rays
from legato.geometry.transforms import Array, invert, look_at, transform

LEG = Leg()
S = SimSettings()
CAMERA = Intrinsics(S.alpha_u, S.alpha_v, S.u0, S.v0, S.k1, S.k2)
CAMERA_FROM_WORLD = invert(look_at(S.camera_at_mm, S.camera_looks_at_mm))


def _camera_from_object(yaw_deg: float = 90.0, shift: tuple[float, float] = (0.0, 0.0)) -> Array:
    """Place the leg near the paper's place; yaw as given, rise as configured."""
    yaw, rise = np.radians([yaw_deg, S.leg_rise_deg])
    x = np.array([np.cos(rise) * np.cos(yaw), np.cos(rise) * np.sin(yaw), np.sin(rise)])
    y = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    at = np.asarray(S.leg_at_mm) + np.array([*shift, 0.0])
    return CAMERA_FROM_WORLD @ transform(np.stack([x, y, np.cross(x, y)], axis=1), at)


def _renderer(blur: float = 0.8) -> Renderer:
    marks = paste_marks(LEG, 10.0, np.random.default_rng(2))
    return Renderer(LEG, CAMERA, marks, blur=blur)


@pytest.fixture(scope="module")
def still() -> Renderer:
    """One renderer whose pose does not change, so that its picture is cast once."""
    return _renderer()


def test_picture_has_the_cameras_size_and_the_seeds_noise(still: Renderer) -> None:
    """The same seed gives the same picture, another seed only other noise."""
    pose = _camera_from_object()
    pictures = [still.render(pose, CAMERA_FROM_WORLD, np.random.default_rng(s)) for s in (1, 1, 2)]
    assert pictures[0].shape == (576, 768)
    assert pictures[0].dtype == np.uint8
    assert np.array_equal(pictures[0], pictures[1])
    difference = pictures[0].astype(float) - pictures[2]
    assert difference.std() == pytest.approx(2.0 * np.sqrt(2.0), rel=0.03)


def test_every_mark_shows_both_tones(still: Renderer) -> None:
    """In the paper's pose all ten marks lie in the picture, each with white and black in it."""
    pose = _camera_from_object()
    clean = still.clean(pose, CAMERA_FROM_WORLD)
    for u, v in np.rint(project(CAMERA, pose, LEG.points())).astype(int):
        around = clean[v - 6 : v + 7, u - 6 : u + 7]
        assert around.shape == (13, 13)
        assert around.max() > 1.8 * around.min()


@pytest.mark.parametrize("yaw_deg", [87.0, 93.5])
def test_marks_lie_right_to_a_hundredth_of_a_pixel(yaw_deg: float) -> None:
    """Against 20 x 20 hard-edged rays a pixel, no mark is shifted by more than 0.01 px.

    The difference of two pictures with swapped tones shows the marks alone.
    """
    pose = _camera_from_object(yaw_deg, (2.0, -1.0))
    light = Light(ambient=1.0, diffuse=0.0)
    one, two = (
        Renderer(LEG, CAMERA, {n: PastedMark(0.1, p) for n in LEG.names()}, light=light, blur=0.8)
        .clean(pose, CAMERA_FROM_WORLD)
        .astype(float)
        for p in (1, -1)
    )
    for name in LEG.names():
        (u, v) = (round(x) for x in project(CAMERA, pose, LEG.points((name,)))[0])
        drawn = (one - two)[v - 10 : v + 11, u - 10 : u + 11]
        true = _brute_mark(pose, name, u, v, turn=0.1)
        slopes = np.stack([g.ravel() for g in np.gradient(true)], axis=-1)
        shift = np.linalg.lstsq(slopes, (drawn - true).ravel(), rcond=None)[0]
        assert np.linalg.norm(shift) < 0.01, name
        assert np.abs(drawn - true).max() < 0.03 * true.max(), name


def _brute_mark(pose: Array, name: str, u: int, v: int, turn: float) -> Array:
    """Return the mark's own part of the 21 x 21 px about (u, v), cast by brute force."""
    n, pad = 20, 15
    offset = (np.arange(n) + 0.5) / n - 0.5
    columns = (u + np.arange(-pad, pad + 1)[:, None] + offset).ravel()
    rows = (v + np.arange(-pad, pad + 1)[:, None] + offset).ravel()
    rays = undistort(CAMERA, np.stack(np.meshgrid(columns, rows), axis=-1))
    points = cast(LEG, *object_rays(pose, rays)).points
    a, b = np.moveaxis(LEG.mark_coordinates(name, points), -1, 0)
    a, b = a * np.cos(turn) + b * np.sin(turn), b * np.cos(turn) - a * np.sin(turn)
    own = (points[..., 0] < 1e-9) == LEG.on_face(name)
    paper = own & (np.maximum(np.abs(a), np.abs(b)) < LEG.mark_size / 2.0)
    sharp = np.where(paper, np.sign(a) * np.sign(b), 0.0) * (PAPER_WHITE - INK) * 255.0
    pixels = sharp.reshape(2 * pad + 1, n, 2 * pad + 1, n).mean(axis=(1, 3))
    blurred = cv2.GaussianBlur(pixels, (0, 0), 0.8)
    return np.asarray(blurred[5:-5, 5:-5])


def test_outline_is_area_sampled(still: Renderer) -> None:
    """Across the leg's top edge the sharp picture passes through tones in between."""
    sharp = _renderer(blur=0.0).clean(_camera_from_object(), CAMERA_FROM_WORLD)
    smooth = still.clean(_camera_from_object(), CAMERA_FROM_WORLD)
    assert np.abs(np.diff(smooth, axis=0)).max() < np.abs(np.diff(sharp, axis=0)).max()
    assert len(np.unique(sharp.round(1))) > 500


def test_the_leg_throws_a_shadow_and_the_lamp_matters() -> None:
    """Another lamp gives another picture; without a lamp everything on the table is darker."""
    pose = _camera_from_object()
    marks = paste_marks(LEG, 0.0, np.random.default_rng(0))
    lit, dark = (
        Renderer(LEG, CAMERA, marks, light=light).clean(pose, CAMERA_FROM_WORLD)
        for light in (Light(), Light(diffuse=0.0))
    )
    drop = lit[400:] - dark[400:]
    assert drop.max() > 20.0
    assert (np.abs(drop) < 0.5).mean() > 0.02  # the shadow gets nothing from the lamp


def test_a_leg_partly_behind_the_camera_is_rendered_all_the_same() -> None:
    """A camera close to the leg's middle gives a picture, not an error."""
    eye = invert(look_at([70.0, -40.0, 8.0], [110.0, 0.0, 0.0]))
    clean = _renderer().clean(eye, eye)
    assert np.isfinite(clean).all()


def test_marks_are_pasted_within_the_hands_turn() -> None:
    """Turns stay inside the limit, both diagonals occur, and the seed decides."""
    drawn = [paste_marks(LEG, 7.0, np.random.default_rng(s)) for s in (3, 3, 4)]
    assert drawn[0] == drawn[1]
    assert drawn[0] != drawn[2]
    assert all(abs(m.turn) <= np.radians(7.0) for m in drawn[0].values())
    assert {m.parity for d in drawn for m in d.values()} == {-1, 1}


def test_a_leg_is_laid_over_what_lies_behind(still: Renderer) -> None:
    """Over another picture the leg is the same, and the rest is that picture; it is not changed."""
    pose = _camera_from_object()
    own = still.sharp(pose, CAMERA_FROM_WORLD)
    behind = np.full_like(own, 0.123)
    laid = still.sharp(pose, CAMERA_FROM_WORLD, behind)
    assert (behind == np.float32(0.123)).all()
    around = np.isclose(laid, 0.123, atol=1e-6)
    scenery = still.scenery(pose, CAMERA_FROM_WORLD)
    assert 0.1 < (~around).mean() < 0.9
    # Along the outline a pixel shows a part of both.
    inner = cv2.erode((~around).astype(np.uint8), np.ones((5, 5))) > 0
    assert np.allclose(laid[inner], own[inner], atol=1e-6)
    outer = cv2.erode(around.astype(np.uint8), np.ones((5, 5))) > 0
    assert np.allclose(own[outer], scenery[outer], atol=1e-6)
