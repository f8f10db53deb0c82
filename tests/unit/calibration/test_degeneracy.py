"""The gate before solving: planes, singular values, flatness, suggestions."""

from collections import Counter
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from legato.calibration.cost import prepare
from legato.calibration.degeneracy import inspect
from legato.calibration.problem import CalibrationError
from legato.calibration.refine import refine
from legato.calibration.suggest import suggest


def test_every_seven_of_the_ten_marks_is_judged_rightly(scenes: Any) -> None:
    """Of 120 choices 8 are coplanar, 56 hang on one mark, and 56 hold P1 and P8 and are sound."""
    found: Counter[str] = Counter()
    for names in combinations(scenes.ten, 7):
        report = inspect(scenes.paper("a", names).problem)
        both = {"P1", "P8"} <= set(names)
        if report.refused:
            found["coplanar"] += 1
            assert set(report.add) == {"P1", "P8"}
        elif report.warnings:
            found["six and one"] += 1
            assert len(report.off_plane) == 1
            assert report.off_plane[0] in report.warnings[0]
            assert not report.linear_start
            assert not both
        else:
            found["sound"] += 1
            assert both
            assert report.linear_start
            assert report.dlt_ratio >= 8e-3
            assert report.flatness >= 0.02
    assert found == {"coplanar": 8, "six and one": 56, "sound": 56}


def test_marks_pasted_by_hand_are_still_coplanar(scenes: Any) -> None:
    """Errors of 0.1 mm in the marks' places do not hide a plane."""
    problem = scenes.paper("a", scenes.coplanar).problem
    moved = problem.points + np.random.default_rng(1).normal(0.0, 0.1, (7, 3))
    assert inspect(replace(problem, points=moved)).refused


def test_a_coplanar_set_fits_perfectly_and_is_wrong(scenes: Any, truth: Any) -> None:
    """Why the gate comes first: below the noise in pixels, millimetres off in the pose."""
    scene = scenes.paper("a", scenes.coplanar)
    model = prepare(scene.problem)
    rng = np.random.default_rng(2)
    starts = truth(scene) + rng.normal(0.0, 1.0, (20, 11)) * [0, 20, 20, 9, 9, 9, 9, 9, 0, 0, 0]
    best = refine(model, starts)
    genes = best.genes[np.argmin(best.cost)]
    assert np.sqrt(best.cost.min() / 14) < 0.25
    assert np.linalg.norm(genes[5:8] - scene.camera_from_object[:3, 3]) > 3.0
    assert inspect(scene.problem).refused


def test_the_best_seven_are_those_of_the_analysis(scenes: Any, truth: Any) -> None:
    """In the paper's pose a, with free intrinsics, P1 P2 P3 P5 P6 P8 P10 know the stations best."""
    scene = scenes.paper("a", scenes.ten)
    assert suggest(scene.problem, truth(scene)) == scenes.seven


def test_no_suggestion_from_one_plane(scenes: Any, truth: Any) -> None:
    """Where every choice is coplanar none is suggested."""
    names = tuple(n for n in scenes.ten if n not in ("P1", "P8"))
    scene = scenes.paper("a", names)
    with pytest.raises(CalibrationError, match="off one plane"):
        suggest(scene.problem, truth(scene))
