"""One mark, to a few hundredths of a pixel."""

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from legato.geometry.transforms import rotation_from_vector, transform
from legato.vision.overlay import NotThere
from legato.vision.picture import Grey
from legato.vision.refine import Refined, noise_of, polish_mark, refine_mark
from legato.vision.view import View


@pytest.mark.parametrize(("blur", "noise"), [(0.5, 1.0), (0.8, 2.0), (1.5, 4.0)])
def test_every_mark_is_right_to_hundredths(
    draw: Callable[..., Any], blur: float, noise: float
) -> None:
    """Over all marks, oblique ones too: under 0.05 px rms, and the sigma tells the error."""
    ratios, errors = [], []
    for seed in (1, 2):
        scene = draw(seed, blur=blur, noise=noise)
        for name in scene.seen():
            rough = refine_mark(scene.image, scene.leg, scene.view, name, noise)
            fine = polish_mark(scene.image, scene.leg, scene.view, name, noise, rough)
            error = fine.pixel - scene.truth(name)
            errors.append(error)
            ratios.append(np.linalg.norm(error) / fine.sigma)
            assert fine.blur == pytest.approx(blur, abs=0.35)
    assert np.sqrt(np.mean(np.square(errors))) < 0.05
    assert max(ratios) < 4.5
    assert np.median(ratios) > 0.3


def test_turn_and_diagonal_come_out(plain: Any) -> None:
    """The picture is symmetrical to nothing: negated levels swap the diagonal and nothing else."""
    negative = 255 - plain.image
    for name in ("P3", "P5", "P8"):
        one = refine_mark(plain.image, plain.leg, plain.view, name, 2.0)
        two = refine_mark(negative, plain.leg, plain.view, name, 2.0)
        assert one.parity == -two.parity
        assert one.turn == pytest.approx(two.turn, abs=0.01)
        assert np.allclose(one.pixel, two.pixel, atol=0.02)
        assert abs(one.turn) < np.radians(12.0)


def test_a_start_that_is_off_is_recovered(plain: Any) -> None:
    """A view 0.34 deg and 0.6 mm off and a start half a pixel off lead to the mark all the same."""
    rng = np.random.default_rng(5)
    pose = plain.view.camera_from_object
    for name in plain.seen():
        turn = rotation_from_vector(rng.normal(size=3) * np.radians(0.2))
        moved = transform(turn @ pose[:3, :3], pose[:3, 3] + rng.normal(size=3) * 0.35)
        near = plain.truth(name) + rng.normal(size=2) * 0.5
        view = View(plain.view.intrinsics, moved)
        rough = refine_mark(plain.image, plain.leg, view, name, 2.0, near)
        assert np.linalg.norm(rough.pixel - plain.truth(name)) < 0.3, name


def _measure(image: Grey, scene: Any, name: str) -> Refined:
    """Refine and polish one mark."""
    rough = refine_mark(image, scene.leg, scene.view, name, 2.0)
    return polish_mark(image, scene.leg, scene.view, name, 2.0, rough)


def test_covered_and_half_covered_marks_are_not_there(plain: Any) -> None:
    """A mark under a disc, and one under half a disc, are refused with a reason."""
    for name, offset in (("P5", 0), ("P6", 18)):
        u, v = (round(x) for x in plain.truth(name))
        image = plain.image.copy()
        cv2.circle(image, (u + offset, v), 20, 110, -1)
        with pytest.raises(NotThere, match=r"hidden|no clear"):
            _measure(image, plain, name)


def test_noise_is_measured(draw: Callable[..., Any]) -> None:
    """The picture's noise comes out to a fifth, edges or not."""
    for noise in (1.0, 2.0, 5.0):
        assert noise_of(draw(4, noise=noise).image) == pytest.approx(noise, rel=0.2)
