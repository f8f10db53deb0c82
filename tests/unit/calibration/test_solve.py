"""The way in: what is refused, and in which words."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from legato.calibration.problem import CalibrationError, EngineSettings, KnownIntrinsics, Problem
from legato.calibration.solve import solve


def refuse(problem: Problem, match: str, engine: str = "hybrid", **settings: Any) -> None:
    """Assert that solving is refused in words that match."""
    with pytest.raises(CalibrationError, match=match):
        solve(problem, engine, EngineSettings(**settings), np.random.default_rng(0))


def test_coplanar_marks_are_refused_with_the_marks_to_add(scenes: Any) -> None:
    """Seven marks of one plane are refused by every engine, known camera or not."""
    scene = scenes.paper("a", scenes.coplanar)
    for engine in ("hybrid", "separable", "paper"):
        refuse(scene.problem, "one plane.*add P8 or P1", engine)
    refuse(scene.known(), "one plane")


@pytest.mark.parametrize(("known", "least"), [(False, 7), (True, 6)])
def test_too_few_marks_are_refused(scenes: Any, known: bool, least: int) -> None:
    """One mark fewer than can be tested is refused, the least number is solved."""
    names = ("P1", "P2", "P3", "P5", "P6", "P8", "P10")
    few, enough = scenes.paper("a", names[: least - 1]), scenes.paper("a", names[:least])
    refuse(few.known() if known else few.problem, f"{least - 1} marks are too few")
    problem = enough.known() if known else enough.problem
    assert solve(problem, "hybrid", EngineSettings(), np.random.default_rng(0)).names


def test_the_paper_engine_needs_seven_even_with_a_known_camera(scenes: Any) -> None:
    """What does not use the known intrinsics cannot live on fewer marks."""
    refuse(scenes.paper("a", scenes.seven[:6]).known(), "too few", "paper")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_no_numbers_are_named(scenes: Any, value: float) -> None:
    """A pixel or point that is not finite is refused with its mark."""
    problem = scenes.paper().problem
    for what in ("pixels", "points"):
        array = getattr(problem, what).copy()
        array[2, 0] = value
        refuse(replace(problem, **{what: array}), f"{what} of P3")


def test_intrinsics_of_another_picture_size_are_refused(scenes: Any) -> None:
    """A camera calibrated at 640x480 says nothing about a picture of 768x576."""
    scene = scenes.paper()
    other = replace(scene.intrinsics, width=640, height=480)
    refuse(scene.known(intrinsics=other), r"of pictures of 640x480 px, this one has 768x576")
    small = replace(scene.known(intrinsics=other), size=(640, 480))
    assert solve(small, "hybrid", EngineSettings(), np.random.default_rng(0)).names


def test_double_names_are_refused(scenes: Any) -> None:
    """A mark given twice is refused by name."""
    problem = scenes.paper().problem
    refuse(replace(problem, names=("P1", *problem.names[:6])), "P1 given more than once")


def test_wrong_shapes_and_sigmas_are_refused(scenes: Any) -> None:
    """Arrays that do not fit the names, and sigmas of zero, are refused."""
    problem = scenes.paper().problem
    refuse(replace(problem, pixels=problem.pixels[:6]), "pixels have shape")
    refuse(replace(problem, sigma=np.zeros(7)), "sigma must be above zero")


def test_two_marks_at_one_pixel_are_refused(scenes: Any) -> None:
    """One picture point cannot be two marks."""
    problem = scenes.paper().problem
    pixels = problem.pixels.copy()
    pixels[1] = pixels[0]
    refuse(replace(problem, pixels=pixels), "P1 and P2 are at one place in the picture")


def test_bad_known_intrinsics_are_refused(scenes: Any) -> None:
    """A covariance of the wrong shape or sign, or a camera of no focal length, is refused."""
    scene = scenes.paper()
    refuse(scene.known(np.zeros((4, 4))), "covariance")
    refuse(scene.known(-np.eye(6)), "covariance")
    camera = replace(scene.intrinsics, alpha_u=0.0)
    refuse(replace(scene.problem, known=KnownIntrinsics(camera)), "alpha_u")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("population", 1),
        ("generations", 0),
        ("elites", 200),
        ("crossover_rate", 1.5),
        ("mutation_rate", -0.1),
        ("mutation_horizon", 2.0),
        ("ranking_pressure", 1.0),
    ],
)
def test_settings_that_cannot_run_are_named(scenes: Any, key: str, value: float) -> None:
    """A setting out of its range is refused with its name and value."""
    settings: dict[str, Any] = {key: value}
    refuse(scenes.paper().problem, key, **settings)


def test_an_unknown_engine_is_refused_with_the_known_ones(scenes: Any) -> None:
    """A misspelt engine is answered by the list of engines."""
    refuse(scenes.paper().problem, "hybrid, paper, separable", "hybird")


def test_no_pose_before_the_camera_is_an_error(scenes: Any) -> None:
    """Bounds that hold every pose behind the camera are refused, not answered by infinity."""
    problem = scenes.paper().problem
    bounds = {**problem.bounds, "t_z": (-300.0, -290.0)}
    for engine in ("hybrid", "separable", "paper"):
        refuse(replace(problem, bounds=bounds), "before the camera", engine, generations=3)
