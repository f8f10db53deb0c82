"""Whole pictures to named marks."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from legato.drivers.sim.render import Renderer, paste_marks
from legato.geometry.projection import undistort
from legato.geometry.raycast import cast, object_rays
from legato.geometry.transforms import invert, look_at, transform
from legato.vision.marks import MarksNotFound, Picking
from legato.vision.pick import find_marks, snap_picks


def _errors(picking: Picking, scene: Any) -> dict[str, float]:
    return {
        n: float(np.linalg.norm(np.array([m.u, m.v]) - scene.truth(n)))
        for n, m in picking.marks.items()
    }


@pytest.mark.parametrize("seed", range(10))
def test_marks_are_found_or_their_absence_is_true(draw: Callable[..., Any], seed: int) -> None:
    """Over poses, blur and noise: every mark within 0.1 px, or missing for the true reason."""
    rng = np.random.default_rng(seed)
    scene = draw(
        seed, scatter=1.6, blur=float(rng.uniform(0.5, 1.2)), noise=float(rng.uniform(1.0, 4.0))
    )
    picking = find_marks(scene.image, scene.leg, scene.view.intrinsics)
    assert max(_errors(picking, scene).values()) < 0.1
    assert set(picking.marks) >= set(scene.seen())
    assert set(picking.marks) | set(picking.missing) == set(scene.leg.names())
    truth = scene.view.unseen(scene.leg, 12.0)
    for name, reason in picking.missing.items():
        assert reason in (truth[name], "too small in the picture", "no clear mark at its place")


def test_guessed_intrinsics_do(draw: Callable[..., Any]) -> None:
    """With alpha 8 % and the principal point 16 px off, the marks are as exact as before."""
    scene = draw(21)
    i = scene.view.intrinsics
    guess = replace(i, alpha_u=i.alpha_u * 1.08, alpha_v=i.alpha_v * 1.08, u0=i.u0 - 16.0, k1=0.0)
    picking = find_marks(scene.image, scene.leg, guess)
    assert len(picking.marks) >= 9
    assert max(_errors(picking, scene).values()) < 0.1


def test_hidden_marks_are_named(draw: Callable[..., Any]) -> None:
    """Three covered marks are missing as hidden, the others as exact as before."""
    scene = draw(22)
    image = scene.image.copy()
    for name in ("P2", "P6", "P8"):
        u, v = (round(x) for x in scene.truth(name))
        cv2.circle(image, (u, v), 34, 120, -1)
    picking = find_marks(image, scene.leg, scene.view.intrinsics)
    assert set(picking.missing) >= {"P2", "P6", "P8"}
    for name in ("P2", "P6", "P8"):
        assert "hidden" in picking.missing[name] or "no clear" in picking.missing[name]
    assert max(_errors(picking, scene).values()) < 0.1


def test_a_misprinted_mark_is_named_not_measured(plain: Any) -> None:
    """With P10 where the paper prints it, P10 is missing and the rest is found in place."""
    marks = dict(plain.leg.marks)
    marks["P10"] = (157.1039, -21.6727, 0.0)
    picking = find_marks(plain.image, replace(plain.leg, marks=marks), plain.view.intrinsics)
    assert "P10" in picking.missing
    assert len(picking.marks) >= 8
    assert max(_errors(picking, plain).values()) < 0.1


@pytest.mark.parametrize("level", [0, 128, 255])
def test_blank_pictures_hold_no_marks(plain: Any, level: int) -> None:
    """Black, grey and white pictures are refused with a hint."""
    blank = np.full_like(plain.image, level)
    with pytest.raises(MarksNotFound) as caught:
        find_marks(blank, plain.leg, plain.view.intrinsics)
    assert caught.value.hint


def test_a_picture_of_another_size_is_refused(plain: Any) -> None:
    """Intrinsics belong to one picture size; both sizes are named."""
    with pytest.raises(MarksNotFound, match=r"400 x 300.*768 x 576"):
        find_marks(plain.image[:300, :400], plain.leg, plain.view.intrinsics)


def test_two_legs_in_sight_are_refused(plain: Any) -> None:
    """Of two legs, one above the other, none is chosen."""
    camera = plain.view.intrinsics
    rng = np.random.default_rng(0)
    far = look_at([60.0, -330.0, 60.0], [95.0, 0.0, 10.0])
    pictures, poses = [], []
    for height in (45.0, -45.0):
        poses.append(invert(far) @ transform(np.eye(3), [0.0, 0.0, height]))
        renderer = Renderer(plain.leg, camera, paste_marks(plain.leg, 8.0, rng), table_z=-90.0)
        pictures.append(renderer.render(poses[-1], invert(far), rng))
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
    rays = undistort(camera, np.stack([u, v], axis=-1))
    second = cast(plain.leg, *object_rays(poses[1], rays)).hit
    both = np.where(second, pictures[1], pictures[0])
    assert len(find_marks(pictures[0], plain.leg, camera).marks) >= 7
    with pytest.raises(MarksNotFound, match="two legs"):
        find_marks(both, plain.leg, camera)


def test_picks_are_snapped_and_refined(plain: Any) -> None:
    """Picks some px off come out as exact as found marks; those not picked are said to be so."""
    rng = np.random.default_rng(3)
    names = ("P1", "P2", "P3", "P5", "P6", "P8", "P10")
    picks = {n: tuple(plain.truth(n) + rng.uniform(-5.0, 5.0, 2)) for n in names}
    picking = snap_picks(plain.image, plain.leg, plain.view.intrinsics, picks)
    assert set(picking.marks) == set(names)
    assert max(_errors(picking, plain).values()) < 0.1
    assert picking.missing == dict.fromkeys(("P4", "P7", "P9"), "not picked")
    assert picking.method == "picks"


def test_a_pick_without_a_mark_is_missing(plain: Any) -> None:
    """A pick on bare wood, a second of one mark, and one beyond all sense are missing, with why."""
    picks = {n: tuple(plain.truth(n)) for n in ("P1", "P2", "P5", "P6", "P8")}
    picks["P3"] = tuple((plain.truth("P3") + plain.truth("P6")) / 2.0)
    picks["P7"] = tuple(plain.truth("P6") + np.array([3.0, 0.0]))
    picks["P9"] = (-1e300, 1e300)
    picking = snap_picks(plain.image, plain.leg, plain.view.intrinsics, picks)
    assert picking.missing["P3"].startswith("no mark within")
    assert picking.missing["P9"].startswith("no mark within")
    assert "P6" in picking.missing["P7"]
    assert set(picking.marks) == {"P1", "P2", "P5", "P6", "P8"}


def test_a_swapped_pick_stays_as_named(plain: Any) -> None:
    """A person's wrong name is not mended here; it keeps its place and a large sigma."""
    names = ("P1", "P2", "P5", "P6", "P8", "P10")
    picks = {n: tuple(plain.truth(n)) for n in names}
    picks["P3"] = tuple(plain.truth("P7"))
    picking = snap_picks(plain.image, plain.leg, plain.view.intrinsics, picks)
    wrong = picking.marks["P3"]
    assert np.linalg.norm([wrong.u, wrong.v] - plain.truth("P7")) < 1.0
    assert wrong.sigma >= 0.5


def test_an_unknown_name_is_refused(plain: Any) -> None:
    """A pick of a mark that the leg does not have is refused with the names it has."""
    with pytest.raises(MarksNotFound, match="no mark P77"):
        snap_picks(plain.image, plain.leg, plain.view.intrinsics, {"P77": (1.0, 1.0)})
