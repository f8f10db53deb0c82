"""Intrinsics from many views: recovery, their covariance, pasted marks, refusals."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from legato.calibration.problem import CalibrationError, EngineSettings, Problem
from legato.calibration.views import calibrate_views, repeats
from legato.geometry.projection import Intrinsics
from legato.geometry.transforms import rotation_from_vector, transform

CAMERA = Intrinsics(652.0, 655.0, 346.0, 279.0, -0.03, 0.0)
TRUE = np.array([652.0, 655.0, 346.0, 279.0, -0.03, 0.0])
QUICK = EngineSettings(search_generations=20)


def views_of(scenes: Any, seed: int, count: int = 10, **options: Any) -> list[Problem]:
    """Return views of one camera from random places."""
    rng = np.random.default_rng(seed)
    found: list[Problem] = []
    while len(found) < count:
        place = scenes.random_place(rng)
        if scenes.all_seen(CAMERA, place):
            number = 1000 * seed + len(found)
            found.append(scenes.seen(CAMERA, place, scenes.ten, seed=number, **options).problem)
    return found


def values(camera: Intrinsics) -> np.ndarray[Any, Any]:
    """Return the six intrinsics."""
    c = camera
    return np.array([c.alpha_u, c.alpha_v, c.u0, c.v0, c.k1, c.k2])


def test_noise_free_views_give_the_camera_exactly(scenes: Any) -> None:
    """Without noise all six intrinsics are recovered to rounding, distortion included."""
    result = calibrate_views(views_of(scenes, 1, noise=0.0), QUICK, np.random.default_rng(1))
    assert result.converged
    np.testing.assert_allclose(values(result.known.intrinsics), TRUE, atol=1e-6)
    assert result.rms_px < 1e-8


def test_ten_noisy_views_agree_with_their_covariance(scenes: Any) -> None:
    """At 0.25 px the focal length is right to 2 %, within four of its sigmas, like the rest."""
    result = calibrate_views(views_of(scenes, 2), QUICK, np.random.default_rng(2))
    error = values(result.known.intrinsics) - TRUE
    sigma = np.sqrt(np.diag(result.known.covariance))
    assert (np.abs(error) < 4.0 * sigma).all()
    assert np.abs(error[:2]).max() < 0.02 * 652.0
    assert result.rms_px == pytest.approx(0.25 * np.sqrt(134 / 200), rel=0.25)
    assert len(result.residuals) == len(result.view_rms_px) == len(result.poses) == 10


def test_pasted_marks_are_found_where_they_are(scenes: Any) -> None:
    """Marks 0.2 mm off spoil the fit unless their places may move."""
    views = views_of(scenes, 3, count=14, sigma=0.05)
    pasted = np.random.default_rng(9).normal(0.0, 0.2, (10, 3))
    views = [replace(v, points=v.points - pasted) for v in views]
    stiff = calibrate_views(views, QUICK, np.random.default_rng(3))
    moved = calibrate_views(views, QUICK, np.random.default_rng(3), mark_sigma=0.2)
    assert moved.rms_px < 0.06 < stiff.rms_px
    sigma = np.sqrt(np.diag(moved.known.covariance))
    assert (np.abs(values(moved.known.intrinsics) - TRUE) < 4.0 * sigma).all()


def test_a_bad_view_shows_in_its_own_residual(scenes: Any) -> None:
    """A view with spoilt marks has the largest rms, and widens the covariance."""
    views = views_of(scenes, 4)
    noise = np.random.default_rng(4).normal(0.0, 6.0, (10, 2))
    spoilt = [replace(v, pixels=v.pixels + noise) if i == 3 else v for i, v in enumerate(views)]
    good = calibrate_views(views, QUICK, np.random.default_rng(4))
    bad = calibrate_views(spoilt, QUICK, np.random.default_rng(4))
    assert int(np.argmax(bad.view_rms_px)) == 3
    assert bad.known.covariance[0, 0] > 4.0 * good.known.covariance[0, 0]


def test_too_few_views_are_refused(scenes: Any) -> None:
    """Nine views are refused with the number that is wanted."""
    with pytest.raises(CalibrationError, match=r"9 views are too few.*at least 10"):
        calibrate_views(views_of(scenes, 5, count=9), QUICK, np.random.default_rng(5))


def test_views_that_repeat_one_another_are_found() -> None:
    """A pose within a millimetre and half a degree of an earlier one is no new view."""
    turns = (0.0, 0.005, 0.3, 0.301, 0.0)
    poses = np.array([transform(rotation_from_vector([0.0, t, 0.0]), np.zeros(3)) for t in turns])
    poses[4, 0, 3] = 1.5
    assert repeats(poses) == {1: 0, 3: 2}


def test_an_unusable_view_is_named(scenes: Any) -> None:
    """Too few marks, NaN, or another picture size is refused with the view's number."""
    views = views_of(scenes, 6)
    pixels = views[2].pixels.copy()
    pixels[0, 0] = np.nan
    few = scenes.paper("a", scenes.seven[:5]).problem
    for wrong, match in (
        (replace(views[2], pixels=pixels), "view 3: pixels of P1"),
        (few, "view 3 has 5 marks"),
        (replace(views[2], size=(640, 480)), "view 3 is 640x480"),
    ):
        with pytest.raises(CalibrationError, match=match):
            calibrate_views([*views[:2], wrong, *views[3:]], QUICK, np.random.default_rng(6))


def test_views_of_one_plane_alone_are_refused(scenes: Any) -> None:
    """Where no view leaves the plane the camera cannot be told."""
    flat = [n for n in scenes.ten if n not in ("P1", "P8")]
    keep = [scenes.ten.index(n) for n in flat]
    views = [
        replace(
            v, names=tuple(flat), points=v.points[keep], pixels=v.pixels[keep], sigma=v.sigma[keep]
        )
        for v in views_of(scenes, 7)
    ]
    with pytest.raises(CalibrationError, match="off one plane"):
        calibrate_views(views, QUICK, np.random.default_rng(7))
