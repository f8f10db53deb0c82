"""Candidates for marks."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from legato.vision.saddle import find_saddles


def _checker(angle: float, skew: float, centre: tuple[float, float]) -> np.ndarray:
    """Draw a checker of two oblique edges through `centre`, blurred, 120 x 160."""
    v, u = np.mgrid[0:960, 0:1280] / 8.0 - 7.0 / 16.0
    a = (u - centre[0]) * np.cos(angle) + (v - centre[1]) * np.sin(angle)
    b = (u - centre[0]) * np.cos(angle + skew) + (v - centre[1]) * np.sin(angle + skew)
    near = np.hypot(u - centre[0], v - centre[1]) < 22.0
    fine = np.where(near, np.where(a * b > 0.0, 220.0, 40.0), 130.0)
    small = fine.reshape(120, 8, 160, 8).mean(axis=(1, 3))
    return np.asarray(np.rint(cv2.GaussianBlur(small, (0, 0), 1.0)), dtype=np.uint8)


@pytest.mark.parametrize("skew_deg", [90.0, 60.0, 40.0])
@pytest.mark.parametrize("angle_deg", [0.0, 25.0, 77.0])
def test_checker_is_found_with_its_edges(angle_deg: float, skew_deg: float) -> None:
    """The crossing is found to 0.15 px and both edges' directions to 11 deg."""
    angle, skew = np.radians([angle_deg, skew_deg])
    centre = (81.3, 60.7)
    found = find_saddles(_checker(angle, skew, centre))
    distance = np.linalg.norm(found.pixels - centre, axis=1)
    k = int(np.argmin(distance))
    assert distance[k] < 0.15
    # An edge runs across the direction in which its coordinate grows.
    for true in (angle + np.pi / 2.0, angle + skew + np.pi / 2.0):
        off = np.abs((found.edges[k] - true + np.pi / 2.0) % np.pi - np.pi / 2.0).min()
        assert off < np.radians(11.0)


def test_large_pictures_show_large_and_small_marks() -> None:
    """In a picture 1600 px wide, a mark of usual size and one five times as large are found."""
    image = np.full((700, 1600), 130, dtype=np.uint8)
    small = _checker(0.3, 1.4, (80.0, 60.0))
    image[100:220, 100:260] = small
    large = cv2.resize(small, None, fx=5, fy=5, interpolation=cv2.INTER_CUBIC)
    image[50:650, 700:1500] = np.clip(large, 0, 255)
    found = find_saddles(image)
    # Resizing keeps the pixels' outer edges in place, not their centres.
    for centre in ((180.0, 160.0), (700.0 + 5 * 80.0 + 2.0, 50.0 + 5 * 60.0 + 2.0)):
        assert np.linalg.norm(found.pixels - centre, axis=1).min() < 0.4


def test_blank_noisy_and_tiny_pictures_have_no_candidates() -> None:
    """Nothing is seen in nothing, and a picture too small for a mark is no error."""
    rng = np.random.default_rng(0)
    blank = np.full((200, 300), 90, dtype=np.uint8)
    noisy = np.clip(rng.normal(120.0, 6.0, (576, 768)), 0, 255).astype(np.uint8)
    for image in (blank, noisy, blank[:3, :3], blank[:1, :1], np.full((50, 60), 255, np.uint8)):
        assert len(find_saddles(image)) == 0


def test_marks_of_a_scene_are_among_few_candidates(plain: Any) -> None:
    """At least nine marks are proposed, each within half a pixel, and little else."""
    found = find_saddles(plain.image)
    near = [np.linalg.norm(found.pixels - plain.truth(n), axis=1).min() for n in plain.seen()]
    assert sum(d < 0.5 for d in near) >= 9
    assert len(found) <= 16


def test_a_limit_keeps_the_most_pronounced(draw: Callable[..., Any]) -> None:
    """`most` bounds the number, and contrast falls along the list."""
    found = find_saddles(draw(3).image, most=4)
    assert len(found) == 4
    assert (np.diff(found.contrast) <= 0.0).all()
