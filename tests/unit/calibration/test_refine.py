"""Levenberg-Marquardt: optima, boxes, priors, left-out marks."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from legato.calibration.cost import cost, prepare
from legato.calibration.derivatives import normal_equations
from legato.calibration.outcome import agreement
from legato.calibration.problem import PAPER_BOUNDS, Problem
from legato.calibration.refine import refine
from legato.geometry.transforms import Array, angles_from_rotation


def near(genes: Array, count: int, seed: int) -> Array:
    """Return starts around genes."""
    spread = np.array([0.1, 2, 2, 5, 5, 5, 5, 5, 0.1, 0.1, 0.1])
    return np.asarray(genes + np.random.default_rng(seed).normal(0.0, 1.0, (count, 11)) * spread)


def test_many_starts_reach_one_optimum(scenes: Any, truth: Any) -> None:
    """Starts around the truth end at the same cost, with a gradient of zero."""
    scene = scenes.paper("a")
    model = prepare(replace(scene.problem, bounds=wide(scene.problem)))
    result = refine(model, near(truth(scene), 20, 1))
    assert result.converged.all()
    np.testing.assert_allclose(result.cost, result.cost.min(), rtol=1e-9)
    _, hessian, gradient = normal_equations(model, result.genes, np.ones((20, 7)))
    scaled = gradient / np.sqrt(np.einsum("bii->bi", hessian))
    assert np.abs(scaled).max() < 1e-5


def test_bounded_optima_meet_the_conditions_of_optimality(scenes: Any, truth: Any) -> None:
    """On a bound the gradient pushes outward, elsewhere it is zero; nothing leaves the box."""
    scene = scenes.paper("a", sigma=1.0)
    bounds = {**PAPER_BOUNDS, "v0": (210.0, 290.0), "t_z": (0.0, 140.0)}
    model = prepare(replace(scene.problem, bounds=bounds))
    result = refine(model, near(truth(scene), 10, 2))
    best = result.genes[np.argmin(result.cost)][None]
    low, high = model.box
    assert (best >= low).all()
    assert (best <= high).all()
    assert best[0, 4] == 290.0 or best[0, 7] == 140.0
    _, hessian, gradient = normal_equations(model, best, np.ones((1, 7)))
    scaled = gradient[0] / np.sqrt(np.diag(hessian[0]))
    moved = model.refined
    at_low, at_high = best[0, moved] <= low[moved], best[0, moved] >= high[moved]
    assert (scaled[at_low] >= -1e-6).all()
    assert (scaled[at_high] <= 1e-6).all()
    assert np.abs(scaled[~at_low & ~at_high]).max() < 1e-4


@pytest.mark.parametrize("seed", [14, 16, 18, 28])
def test_a_bound_does_not_feign_convergence(scenes: Any, seed: int) -> None:
    """In a flat valley along a bound all that converge near the best cost share it to 1e-6."""
    scene = scenes.random(seed, scenes.six_and_one, sigma=0.5)
    bounds = {**PAPER_BOUNDS, "v0": (scene.intrinsics.v0 + 15.0, 330.0)}
    model = prepare(replace(scene.problem, bounds=bounds))
    starts = np.random.default_rng(seed).uniform(model.search[0], model.search[1], (60, 11))
    result = refine(model, starts)
    near_best = result.converged & (result.cost <= 1.01 * result.cost.min())
    assert near_best.sum() >= 10
    np.testing.assert_allclose(result.cost[near_best], result.cost.min(), rtol=1e-6)


def test_the_alphas_are_refined_and_f_is_held(scenes: Any, truth: Any) -> None:
    """Genes that share their alphas are one start; where s_x is fixed f itself moves."""
    scene = scenes.paper("a", scenes.ten)
    genes = np.tile(truth(scene), (2, 1))
    genes[1, :3] *= [2.0, 0.5, 0.5]
    model = prepare(scene.problem)
    result = refine(model, genes)
    np.testing.assert_allclose(result.genes[0], result.genes[1], rtol=1e-9)
    assert (result.genes[:, 0] == 1.0).all()
    pitch = scene.intrinsics.alpha_u / 5.0
    fixed = {**scene.problem.bounds, "s_x": (pitch, pitch)}
    held = refine(prepare(replace(scene.problem, bounds=fixed)), genes)
    np.testing.assert_allclose(held.genes[:, 1], pitch)
    np.testing.assert_allclose(held.cost, result.cost, rtol=1e-6)


def test_what_enough_have_met_is_not_waited_for(scenes: Any, truth: Any) -> None:
    """Once enough have converged to the least cost the rest is broken off, and said to be."""
    scene = scenes.paper("a", scenes.ten)
    model = prepare(scene.problem)
    far = np.random.default_rng(7).uniform(model.search[0], model.search[1], (30, 11))
    starts = np.concatenate([near(truth(scene), 10, 6), far])
    all_of_them, some = refine(model, starts), refine(model, starts, enough=5)
    assert some.rounds < all_of_them.rounds
    assert some.unfinished.any()
    assert not all_of_them.unfinished.any()
    assert not (some.unfinished & some.converged).any()
    assert np.count_nonzero(some.at_best() & some.converged) >= 5
    assert some.cost.min() == pytest.approx(all_of_them.cost.min(), rel=1e-6)
    nearly = refine(model, starts, enough=5, ended=36)
    assert nearly.unfinished.sum() <= 4
    assert agreement(some) == some.at_best()[~some.unfinished].mean()


def test_no_step_raises_the_cost(scenes: Any) -> None:
    """From anywhere before the camera the result costs no more than the start."""
    model = prepare(scenes.paper("c").problem)
    starts = np.random.default_rng(3).uniform(model.search[0], model.search[1], (100, 11))
    result = refine(model, starts)
    assert (result.cost <= cost(model, starts)).all()
    solved = np.isfinite(result.cost)
    assert solved.any()
    np.testing.assert_allclose(
        cost(model, result.genes)[solved], result.cost[solved], rtol=1e-9, atol=1e-12
    )


def test_a_batch_is_its_members(scenes: Any, truth: Any) -> None:
    """What is refined together is what is refined alone."""
    scene = scenes.paper("d")
    model = prepare(scene.problem)
    starts = near(truth(scene), 4, 4)
    together = refine(model, starts)
    for i in range(4):
        alone = refine(model, starts[i : i + 1])
        np.testing.assert_allclose(alone.genes[0], together.genes[i], rtol=1e-6, atol=1e-6)


def test_a_left_out_mark_has_no_pull(scenes: Any, truth: Any) -> None:
    """With weight zero a mark 300 px off leaves the optimum where it was."""
    scene = scenes.paper("a", scenes.ten)
    pixels = scene.problem.pixels.copy()
    pixels[9] += 300.0
    weights = np.ones((1, 10))
    weights[0, 9] = 0.0
    start = truth(scene)[None]
    clean = refine(prepare(scene.problem), start, weights)
    spoilt = refine(prepare(replace(scene.problem, pixels=pixels)), start, weights)
    np.testing.assert_allclose(clean.genes, spoilt.genes, rtol=1e-7, atol=1e-7)


def test_the_prior_pulls_by_its_weight(scenes: Any) -> None:
    """A tight covariance holds the intrinsics, a loose one lets the marks move them."""
    scene = scenes.random(3, scenes.ten)
    wrong = replace(scene.intrinsics, alpha_u=scene.intrinsics.alpha_u * 1.01)
    moved = []
    for sigma in (1e-3, 100.0):
        covariance = np.diag([sigma**2] * 4 + [0.0, 0.0])
        model = prepare(scene.known(covariance, wrong))
        start = model.mean.copy()
        start[5:8] = scene.camera_from_object[:3, 3]
        start[8:11] = angles_from_rotation(scene.camera_from_object[:3, :3])
        moved.append(abs(refine(model, start[None]).genes[0, 1] - wrong.alpha_u))
    assert moved[0] < 1e-3
    assert moved[1] > 1.0


def wide(problem: Problem) -> dict[str, tuple[float, float]]:
    """Return bounds that no optimum near the truth touches."""
    return {**problem.bounds, "u0": (0.0, 768.0), "v0": (0.0, 576.0), "t_z": (0.0, 900.0)}
