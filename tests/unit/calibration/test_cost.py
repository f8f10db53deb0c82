"""The cost: what it prices, what it refuses, and its derivatives."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.calibration.cost import cost, mark_costs, prepare, residuals, split_alphas
from legato.calibration.derivatives import jacobian, normal_equations
from legato.calibration.problem import PAPER_BOUNDS, CalibrationError
from legato.geometry.transforms import angles_from_rotation


def test_truth_costs_nothing(scenes: Any, truth: Any) -> None:
    """Noise-free marks fit their true camera and pose to rounding."""
    scene = scenes.paper("a", noise=0.0)
    assert cost(prepare(scene.problem), truth(scene)[None])[0] < 1e-18


def test_a_mark_behind_the_camera_costs_infinity(scenes: Any, truth: Any) -> None:
    """Mirrored through the camera the formula fits perfectly: only the depth tells."""
    scene = scenes.paper("a", noise=0.0)
    genes = truth(scene)
    genes[7] = -genes[7]
    assert cost(prepare(scene.problem), genes[None])[0] == np.inf


def test_a_population_is_priced_as_its_members_are(scenes: Any) -> None:
    """A batch gives the same costs as one individual at a time, finite or not."""
    model = prepare(scenes.paper("c").problem)
    rng = np.random.default_rng(3)
    genes = rng.uniform(model.search[0], model.search[1], (600, 11))
    together = cost(model, genes)
    assert np.isinf(together).any()
    assert np.isfinite(together).any()
    np.testing.assert_allclose(together, [cost(model, g[None])[0] for g in genes], rtol=1e-12)
    weights = rng.uniform(0.5, 1.0, (600, 7))
    alone = [cost(model, genes[i : i + 1], weights[i : i + 1])[0] for i in range(600)]
    np.testing.assert_allclose(cost(model, genes, weights), alone, rtol=1e-12)


def test_the_marks_share_the_cost(scenes: Any) -> None:
    """Each mark's part adds up to the whole; a mark behind the camera has a huge one."""
    model = prepare(scenes.paper("c").problem)
    genes = np.random.default_rng(4).uniform(model.search[0], model.search[1], (600, 11))
    parts, whole = mark_costs(model, genes), cost(model, genes)
    seen = np.isfinite(whole)
    np.testing.assert_allclose(parts[seen].sum(axis=1), whole[seen], rtol=1e-12)
    assert (parts[~seen].max(axis=1) >= 1e12).all()


def test_the_normal_equations_carry_the_cost(scenes: Any) -> None:
    """What the refinement minimises is the cost, prior and left-out marks included."""
    scene = scenes.random(5, scenes.ten)
    model = prepare(scene.known(np.diag([4.0, 4.0, 9.0, 9.0, 0.0, 0.0])))
    genes = np.random.default_rng(5).uniform(model.search[0], model.search[1], (40, 11))
    genes[:, 1:5] += np.random.default_rng(6).normal(0.0, 3.0, (40, 4))
    weights = np.ones((40, 10))
    weights[::2, 3] = 0.0
    value, hessian, gradient = normal_equations(model, genes, weights)
    np.testing.assert_allclose(value, cost(model, genes, weights), rtol=1e-9)
    assert hessian.shape == (40, 10, 10)
    assert gradient.shape == (40, 10)


def test_cost_is_the_weighted_sum_of_squares(scenes: Any, truth: Any) -> None:
    """A mark of twice the sigma counts a quarter; equal marks count in plain px^2."""
    scene = scenes.paper("a")
    genes = truth(scene)[None]
    even = prepare(scene.problem)
    squares = np.sum(residuals(even, genes)[0] ** 2, axis=1)
    assert cost(even, genes)[0] == pytest.approx(squares.sum())
    sigma = np.full(7, 0.25)
    sigma[2] = 0.5
    uneven = prepare(replace(scene.problem, sigma=sigma))
    counts = (uneven.sigma / sigma) ** 2
    assert counts[2] == pytest.approx(counts[0] / 4.0)
    assert cost(uneven, genes)[0] == pytest.approx(float(counts @ squares))


def test_a_weight_of_zero_leaves_a_mark_out(scenes: Any, truth: Any) -> None:
    """A mark that weighs nothing changes nothing, wherever it was seen."""
    scene = scenes.paper("a")
    weights = np.ones(7)
    weights[4] = 0.0
    pixels = scene.problem.pixels.copy()
    pixels[4] += 300.0
    a = cost(prepare(scene.problem), truth(scene)[None], weights)
    b = cost(prepare(replace(scene.problem, pixels=pixels)), truth(scene)[None], weights)
    assert a[0] == pytest.approx(b[0])


def test_known_distortion_is_taken_out_once(scenes: Any) -> None:
    """With the intrinsics known, distorted pixels fit a pure pinhole."""
    scene = scenes.random(4, noise=0.0, k1=-0.05)
    model = prepare(scene.known())
    genes = model.mean.copy()
    place = scene.camera_from_object
    genes[5:8], genes[8:11] = place[:3, 3], angles_from_rotation(place[:3, :3])
    assert cost(model, genes[None])[0] < 1e-16
    assert set(model.refined) == set(range(5, 11))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_jacobian_agrees_with_finite_differences(scenes: Any, truth: Any, seed: int) -> None:
    """The analytic derivatives are those of the residuals, for any pose before the camera."""
    rng = np.random.default_rng(seed)
    scene = scenes.paper("acd"[seed % 3])
    model = prepare(scene.problem)
    genes = truth(scene) + rng.normal(0.0, 1.0, 11) * [0.3, 5, 5, 9, 9, 6, 6, 6, 0.2, 0.2, 0.2]
    _, analytic = jacobian(model, genes[None])
    for k in range(11):
        step = np.zeros(11)
        step[k] = 1e-6 * max(1.0, abs(genes[k]))
        rise = residuals(model, (genes + step)[None]) - residuals(model, (genes - step)[None])
        np.testing.assert_allclose(
            analytic[0, :, :, k], rise[0] / (2 * step[k]), rtol=1e-5, atol=1e-4
        )


@given(f=st.floats(3.0, 25.0), s_x=st.floats(90.0, 250.0), s_y=st.floats(90.0, 250.0))
def test_alphas_split_inside_the_bounds(f: float, s_x: float, s_y: float) -> None:
    """Any alphas that the bounds allow are split into f, s_x, s_y within them."""
    bounds = np.array(list(PAPER_BOUNDS.values())).T
    parts = split_alphas(np.array([[f * s_x, f * s_y]]), bounds)[0]
    assert parts[0] * parts[1] == pytest.approx(f * s_x)
    assert parts[0] * parts[2] == pytest.approx(f * s_y)
    assert (parts >= bounds[0, :3] * (1 - 1e-12)).all()
    assert (parts <= bounds[1, :3] * (1 + 1e-12)).all()


@pytest.mark.parametrize("bad", [(5.0, 3.0), (float("nan"), 1.0), (0.0, float("inf"))])
def test_bad_bounds_are_named(scenes: Any, bad: tuple[float, float]) -> None:
    """Bounds that are no interval are refused with the gene's name."""
    problem = replace(scenes.paper().problem, bounds={**PAPER_BOUNDS, "u0": bad})
    with pytest.raises(CalibrationError, match="u0"):
        prepare(problem)


def test_missing_bounds_are_named(scenes: Any) -> None:
    """A gene with no bounds is refused by name."""
    bounds = {k: v for k, v in PAPER_BOUNDS.items() if k != "kappa"}
    with pytest.raises(CalibrationError, match="kappa"):
        prepare(replace(scenes.paper().problem, bounds=bounds))
