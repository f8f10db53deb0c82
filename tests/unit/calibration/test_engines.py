"""Hybrid and separable: the global optimum, exact recovery, reproducible."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from legato.calibration.cost import prepare
from legato.calibration.problem import EngineSettings
from legato.calibration.refine import refine
from legato.calibration.solve import solve

SETTINGS = EngineSettings()
BOTH = pytest.mark.parametrize("engine", ["hybrid", "separable"])


@BOTH
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("pose", ["a", "c", "d"])
def test_noise_free_marks_give_the_pose_exactly(
    scenes: Any, engine: str, known: bool, pose: str
) -> None:
    """Without noise the pose is right to 1e-6 deg and mm, known and free intrinsics alike."""
    scene = scenes.paper(pose, noise=0.0)
    problem = scene.known() if known else scene.problem
    s = solve(problem, engine, SETTINGS, np.random.default_rng(1))
    turned, moved = scene.errors(s.camera_from_object)
    assert np.degrees(turned) < 1e-6
    assert moved < 1e-6
    assert s.stopped_by == "converged"
    assert s.intrinsics.alpha_u == pytest.approx(scene.intrinsics.alpha_u, abs=1e-6)


@BOTH
@pytest.mark.parametrize("marks", ["seven", "ten", "six_and_one"])
def test_the_global_optimum_is_found(scenes: Any, truth: Any, engine: str, marks: str) -> None:
    """No refinement of the truth or of 100 random starts costs less, 6 + 1 marks included."""
    for seed in range(6):
        scene = scenes.random(50 + seed, getattr(scenes, marks), sigma=0.5)
        model, rng = prepare(scene.problem), np.random.default_rng(seed)
        starts = rng.uniform(model.search[0], model.search[1], (100, 11))
        starts[0] = truth(scene)
        rival = refine(model, starts).cost.min()
        s = solve(scene.problem, engine, SETTINGS, rng)
        assert s.cost <= rival * 1.01
        assert 0.0 < s.agreement <= 1.0


@BOTH
def test_known_intrinsics_search_the_pose_alone(scenes: Any, engine: str) -> None:
    """Exactly known intrinsics stay as given and leave no row in the covariance."""
    scene = scenes.random(7, k1=-0.03)
    s = solve(scene.known(), engine, SETTINGS, np.random.default_rng(2))
    assert s.intrinsics == scene.intrinsics
    assert (s.covariance[:4] == 0.0).all()
    turned, moved = scene.errors(s.camera_from_object)
    assert turned < 4.0 * s.sigma_rotation
    assert moved < 4.0 * s.sigma_translation
    assert s.agreement > 0.5
    assert s.on_bound == ()


@BOTH
def test_engines_repeat_themselves(scenes: Any, engine: str) -> None:
    """The same seed gives the same solution to the last bit."""
    problem = scenes.paper("c").problem
    a, b = (solve(problem, engine, SETTINGS, np.random.default_rng(9)) for _ in range(2))
    np.testing.assert_array_equal(a.genes, b.genes)
    assert a.trace == b.trace


def test_both_engines_reach_one_optimum(scenes: Any) -> None:
    """Hybrid and separable agree on what is observable."""
    problem = scenes.random(11, scenes.ten).problem
    a, b = (solve(problem, e, SETTINGS, np.random.default_rng(3)) for e in ("hybrid", "separable"))
    np.testing.assert_allclose(a.camera_from_object, b.camera_from_object, atol=1e-4)
    assert a.intrinsics.alpha_v == pytest.approx(b.intrinsics.alpha_v, rel=1e-6)


def test_a_bound_that_is_met_is_named(scenes: Any) -> None:
    """A truth outside the bounds ends on the bound, and the solution says so."""
    scene = scenes.random(12)
    bounds = {**scene.problem.bounds, "t_z": (0.0, 40.0)}
    s = solve(replace(scene.known(), bounds=bounds), "hybrid", SETTINGS, np.random.default_rng(4))
    assert "t_z" in s.on_bound


def test_the_solution_is_consistent(scenes: Any) -> None:
    """Residuals, rms and cost tell the same story, and genes stay within their bounds."""
    scene = scenes.paper("a", scenes.ten)
    s = solve(scene.problem, "hybrid", SETTINGS, np.random.default_rng(5))
    assert s.residuals.shape == (10, 2)
    assert s.rms_px == pytest.approx(np.sqrt(np.mean(s.residuals**2)))
    assert s.cost == pytest.approx(np.sum(s.residuals**2))
    box = prepare(scene.problem).search
    assert (s.genes >= box[0] - 1e-9).all()
    assert (s.genes <= box[1] + 1e-9).all()
    assert s.sigma_stations.shape == (4,)
