"""Left-out marks: prediction within the stated sigma, and wrong marks named."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from legato.calibration.heldout import held_out, suspects
from legato.calibration.problem import EngineSettings, Problem
from legato.calibration.solve import solve

SETTINGS = EngineSettings()


def misprinted(problem: Problem) -> Problem:
    """Return the problem with P10 as the paper prints it: y copied from P7."""
    points = problem.points.copy()
    points[problem.names.index("P10"), 1] = -21.6727
    return replace(problem, points=points)


@pytest.mark.parametrize("known", [True, False])
def test_marks_are_predicted_within_their_uncertainty(scenes: Any, known: bool) -> None:
    """Over scenes the ratio of prediction error to its sigma has a root mean square of one."""
    ratios = []
    for seed in range(12):
        scene = scenes.random(seed, scenes.ten)
        problem = scene.known() if known else scene.problem
        s = solve(problem, "separable", SETTINGS, np.random.default_rng(seed))
        rows = held_out(problem, s)
        assert tuple(r.name for r in rows) == scenes.ten
        ratios += [r.ratio for r in rows]
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.2)


def test_a_mark_that_alone_leaves_the_plane_cannot_be_tested(scenes: Any) -> None:
    """Without it the others are coplanar: its prediction is infinite, not reassuring."""
    scene = scenes.paper("a", scenes.six_and_one)
    s = solve(scene.problem, "hybrid", SETTINGS, np.random.default_rng(1))
    rows = {r.name: r for r in held_out(scene.problem, s)}
    assert np.isinf(rows["P1"].ratio)
    assert np.isfinite(rows["P2"].ratio)


def test_a_known_camera_predicts_from_one_plane(scenes: Any) -> None:
    """With known intrinsics the coplanar rest does give a pose: its prediction is fair."""
    ratios = []
    for seed in range(12):
        scene = scenes.random(70 + seed, scenes.six_and_one)
        s = solve(scene.known(), "hybrid", SETTINGS, np.random.default_rng(seed))
        rows = {r.name: r for r in held_out(scene.known(), s)}
        ratios.append(rows["P1"].ratio)
        assert rows["P1"].sigma_px > 1.5 * min(r.sigma_px for r in rows.values())
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.45)


def test_a_wrong_mark_off_the_plane_is_seen_by_a_known_camera(scenes: Any) -> None:
    """Alone off the plane and 6 px off, it lies far from what the plane's pose predicts."""
    scene = scenes.random(72, scenes.six_and_one)
    pixels = scene.problem.pixels.copy()
    pixels[0] += [6.0, 6.0]
    problem = replace(scene.known(), pixels=pixels)
    s = solve(problem, "hybrid", SETTINGS, np.random.default_rng(2))
    rows = {r.name: r for r in held_out(problem, s)}
    assert 4.0 < rows["P1"].ratio < np.inf


@pytest.mark.parametrize("known", [True, False])
def test_swapped_marks_of_the_face_are_not_explained_away(scenes: Any, known: bool) -> None:
    """P1 taken for P8 leaves the fit out of the noise, and held-out marks far off."""
    for seed in range(2):
        scene = scenes.random(90 + seed, scenes.ten)
        pixels = scene.problem.pixels.copy()
        pixels[[0, 7]] = pixels[[7, 0]]
        problem = replace(scene.known() if known else scene.problem, pixels=pixels)
        rng = np.random.default_rng(seed)
        s = solve(problem, "hybrid", SETTINGS, rng)
        found = suspects(problem, s, SETTINGS, rng)
        assert found.misfit > 5.0 * found.limit
        assert max(r.ratio for r in held_out(problem, s)) > 10.0
        assert not found.names or set(found.names) == {"P1", "P8"}


@pytest.mark.parametrize("known", [True, False])
def test_the_misprinted_mark_is_named(scenes: Any, known: bool) -> None:
    """With the paper's P10 the fit is out of the noise, and P10 alone explains it."""
    for seed in range(4):
        scene = scenes.random(20 + seed, scenes.ten)
        problem = misprinted(scene.known() if known else scene.problem)
        rng = np.random.default_rng(seed)
        s = solve(problem, "separable", SETTINGS, rng)
        found = suspects(problem, s, SETTINGS, rng)
        assert found.names == ("P10",)
        assert found.misfit > found.limit
        assert found.others == ()


def test_swapped_labels_are_named_both(scenes: Any) -> None:
    """Two marks labelled as each other are found as a pair."""
    scene = scenes.random(31, scenes.ten)
    pixels = scene.problem.pixels.copy()
    pixels[[3, 6]] = pixels[[6, 3]]
    problem = replace(scene.known(), pixels=pixels)
    rng = np.random.default_rng(3)
    s = solve(problem, "separable", SETTINGS, rng)
    found = suspects(problem, s, SETTINGS, rng)
    assert set(found.names) == {scenes.ten[3], scenes.ten[6]}


def test_good_marks_are_not_suspected(scenes: Any) -> None:
    """Noise alone names nobody."""
    for seed in range(10):
        scene = scenes.random(40 + seed, scenes.ten)
        rng = np.random.default_rng(seed)
        s = solve(scene.known(), "separable", SETTINGS, rng)
        found = suspects(scene.known(), s, SETTINGS, rng)
        assert found.names == ()
        assert found.explained


def test_what_two_marks_cannot_explain_is_said(scenes: Any) -> None:
    """Marks wrong throughout name nobody and are not explained."""
    scene = scenes.random(60, scenes.seven)
    noise = np.random.default_rng(5).normal(0.0, 15.0, (7, 2))
    problem = replace(scene.known(), pixels=scene.problem.pixels + noise)
    rng = np.random.default_rng(6)
    s = solve(problem, "separable", SETTINGS, rng)
    found = suspects(problem, s, SETTINGS, rng)
    assert found.names == ()
    assert not found.explained
