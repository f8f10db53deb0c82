"""Covariances: the known bounds of this target, calibration, and the camera's own error."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from legato.calibration.cost import prepare
from legato.calibration.outcome import goodness
from legato.calibration.problem import EngineSettings, Solution
from legato.calibration.solve import solve
from legato.calibration.uncertainty import (
    covariance_of,
    noise_limit,
    station_sigmas,
    widening,
)
from legato.geometry.transforms import Array

SETTINGS = EngineSettings()
LENS = ("alpha_u", "alpha_v", "u0", "v0", "k1", "k2")

# Cramer-Rao bounds for 1 px of noise in pose a: rotation deg, translation mm, worst station mm.
BOUNDS = [
    ("seven", False, 3.61, 12.8, 22.1),
    ("ten", False, 3.18, 11.5, 20.0),
    ("seven", True, 0.344, 0.548, 0.552),
]


@pytest.mark.parametrize(("marks", "known", "turned", "moved", "station"), BOUNDS)
def test_the_bounds_of_pose_a(
    scenes: Any, truth: Any, marks: str, known: bool, turned: float, moved: float, station: float
) -> None:
    """Sigmas at the truth are the Cramer-Rao bounds, found apart by another program."""
    scene = scenes.paper("a", getattr(scenes, marks), sigma=1.0)
    genes = truth(scene)
    if known:
        genes[:3] = [1.0, 5.0 * genes[1], 5.0 * genes[2]]
    problem = scene.known() if known else scene.problem
    c = covariance_of(problem, prepare(problem), genes)
    assert np.degrees(np.sqrt(np.trace(c[4:7, 4:7]))) == pytest.approx(turned, rel=5e-3)
    assert np.sqrt(np.trace(c[7:, 7:])) == pytest.approx(moved, rel=5e-3)
    assert station_sigmas(c, genes, scenes.stations).max() == pytest.approx(station, rel=1e-2)


def pose_error(scene: Any, s: Solution) -> Array:
    """Return the error of a pose: small rotation vector (camera frame) and translation."""
    turn = s.camera_from_object[:3, :3] @ scene.camera_from_object[:3, :3].T
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    moved = s.camera_from_object[:3, 3] - scene.camera_from_object[:3, 3]
    return np.concatenate([vector / 2.0, moved])


def scaled_errors(scenes: Any, count: int, kind: str) -> Array:
    """Return squared errors of the pose (count,) in units of their covariance; 6 on average."""
    sigma = np.array([1.5, 1.5, 2.0, 2.0, 0.01, 0.02])
    mix = np.random.default_rng(5).normal(size=(6, 6))
    c = mix @ mix.T
    c *= np.outer(sigma, sigma) / np.sqrt(np.outer(np.diag(c), np.diag(c)))
    out = []
    for seed in range(count):
        scene = scenes.random(300 + seed, k1=0.0 if kind == "free" else -0.02)
        problem = scene.problem if kind == "free" else scene.known()
        if kind == "uncertain":
            i = scene.intrinsics
            true = np.array([i.alpha_u, i.alpha_v, i.u0, i.v0, i.k1, i.k2])
            drawn = np.random.default_rng(seed).multivariate_normal(true, c)
            problem = scene.known(c, replace(i, **dict(zip(LENS, drawn.tolist(), strict=True))))
        s = solve(problem, "separable", SETTINGS, np.random.default_rng(seed))
        e = pose_error(scene, s)
        out.append(e @ np.linalg.solve(s.covariance[4:, 4:], e))
    return np.array(out)


@pytest.mark.parametrize("kind", ["known", "uncertain", "free"])
def test_sigmas_are_calibrated(scenes: Any, kind: str) -> None:
    """Pose errors scatter as the covariance says, the camera's own error included."""
    squared = scaled_errors(scenes, 60, kind)
    # The mean of 60 chi-squares with 6 degrees of freedom is 6 +- 0.45.
    assert 4.3 < squared.mean() < 7.7


def test_an_uncertain_camera_costs_certainty(scenes: Any) -> None:
    """The error of the intrinsics, k1 alone too, widens the pose; none leaves it."""
    scene = scenes.random(8, scenes.ten, sigma=0.05)
    sigmas = []
    for variance in ([0.0] * 6, [0, 0, 0, 0, 1e-4, 0], [4.0, 4.0, 4.0, 4.0, 1e-4, 0.0]):
        problem = scene.known(np.diag(variance))
        s = solve(problem, "separable", SETTINGS, np.random.default_rng(1))
        sigmas.append(s.sigma_translation)
    assert sigmas[0] < sigmas[1] < sigmas[2]


def test_alphas_keep_their_covariance_rows(scenes: Any) -> None:
    """With a prior the intrinsics are no worse known than before the picture."""
    scene = scenes.random(9, scenes.ten)
    prior = np.diag([4.0, 4.0, 9.0, 9.0, 0.0, 0.0])
    s = solve(scene.known(prior), "hybrid", SETTINGS, np.random.default_rng(2))
    kept = np.diag(s.covariance)[:4]
    assert (kept > 0.0).all()
    assert (kept <= np.diag(prior)[:4] * (1 + 1e-9)).all()


def test_goodness_tells_noise_from_error(scenes: Any) -> None:
    """Marks with the noise they claim pass; with four times as much they do not."""
    for noise, fits in ((0.25, True), (1.0, False)):
        scene = scenes.random(10, scenes.ten, noise=noise)
        s = solve(scene.known(), "separable", SETTINGS, np.random.default_rng(3))
        value, limit = goodness(scene.known(), s)
        assert (value <= limit) is fits


@pytest.mark.parametrize(("freedom", "quantile"), [(4, 18.47), (8, 26.12), (14, 36.12)])
def test_the_limit_of_noise_is_its_quantile(freedom: int, quantile: float) -> None:
    """The approximation meets the tabled 99.9 % points of chi-square within 2 %."""
    assert noise_limit(freedom) == pytest.approx(quantile, rel=0.02)


def test_only_a_misfit_widens() -> None:
    """Within the noise a covariance keeps its a-priori size."""
    assert widening(8.0, 8) == 1.0
    assert widening(26.0, 8) == 1.0
    assert widening(80.0, 8) == 10.0


def test_sigmas_grow_with_the_noise(scenes: Any, truth: Any) -> None:
    """Twice the pixel noise is twice the uncertainty."""
    one, two = (scenes.paper("a", sigma=s, noise=0.0) for s in (0.2, 0.4))
    a = covariance_of(one.problem, prepare(one.problem), truth(one))
    b = covariance_of(two.problem, prepare(two.problem), truth(two))
    np.testing.assert_allclose(b, 4.0 * a, rtol=1e-6, atol=1e-9)
