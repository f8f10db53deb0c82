"""Which candidate is which mark."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from legato.geometry.transforms import Array
from legato.vision.hypotheses import view_of_named
from legato.vision.label import Labelling, label
from legato.vision.marks import MarksNotFound
from legato.vision.saddle import Candidates, find_saddles
from legato.vision.view import View


def _label(candidates: Candidates, scene: Any, nominal: Any = None, **more: Any) -> Labelling:
    camera = nominal if nominal is not None else scene.view.intrinsics
    return label(candidates, scene.leg, camera, np.random.default_rng(0), **more)


def _assert_true(labelling: Labelling, candidates: Candidates, scene: Any) -> None:
    for name, k in labelling.chosen.items():
        assert np.linalg.norm(candidates.pixels[k] - scene.truth(name)) < 2.0, name


def _with(candidates: Candidates, pixels: Array, edges: Array) -> Candidates:
    """Candidates and more of them."""
    return Candidates(
        np.concatenate([candidates.pixels, pixels]),
        np.concatenate([candidates.contrast, np.full(len(pixels), 50.0)]),
        np.concatenate([candidates.edges, edges]),
    )


@pytest.mark.parametrize("seed", range(6))
def test_scattered_legs_are_labelled(draw: Callable[..., Any], seed: int) -> None:
    """At least seven marks are named, all rightly, over doubled scatter."""
    scene = draw(seed, scatter=2.0)
    candidates = find_saddles(scene.image)
    labelling = _label(candidates, scene)
    assert len(labelling.chosen) >= 7
    _assert_true(labelling, candidates, scene)


@pytest.mark.parametrize(("scale", "shift"), [(1.1, 20.0), (0.9, -20.0)])
def test_wrong_intrinsics_are_lived_with(plain: Any, scale: float, shift: float) -> None:
    """A tenth in alpha and 20 px in the principal point do not mislead."""
    i = plain.view.intrinsics
    wrong = replace(
        i, alpha_u=i.alpha_u * scale, alpha_v=i.alpha_v * scale, u0=i.u0 + shift, v0=i.v0 - shift
    )
    candidates = find_saddles(plain.image)
    labelling = _label(candidates, plain, wrong)
    assert len(labelling.chosen) >= 9
    _assert_true(labelling, candidates, plain)


def test_clutter_and_missing_marks_do_not_mislead(plain: Any) -> None:
    """With three marks gone and eight false candidates, the others keep their names."""
    rng = np.random.default_rng(8)
    candidates = find_saddles(plain.image)
    gone = [plain.truth(n) for n in ("P3", "P7", "P9")]
    kept = [
        k for k, p in enumerate(candidates.pixels) if min(np.linalg.norm(p - g) for g in gone) > 3.0
    ]
    less = candidates.take(np.asarray(kept))
    first = rng.uniform(0.0, np.pi, 8)
    edges = np.stack([first, first + rng.uniform(0.8, 2.3, 8)], axis=1)
    more = _with(less, rng.uniform([20, 20], [740, 550], (8, 2)), edges)
    labelling = _label(more, plain)
    assert len(labelling.chosen) >= 6
    _assert_true(labelling, more, plain)


def test_a_prior_view_saves_the_search(plain: Any) -> None:
    """A view a degree and some mm off leads to the right names without any search."""
    from legato.geometry.transforms import rotation_from_vector, transform

    pose = plain.view.camera_from_object
    near = transform(
        rotation_from_vector([0.01, -0.01, 0.01]) @ pose[:3, :3], pose[:3, 3] + [1.0, -1.0, 3.0]
    )
    candidates = find_saddles(plain.image)
    labelling = _label(candidates, plain, prior=View(plain.view.intrinsics, near), rounds=0)
    assert len(labelling.chosen) >= 9
    _assert_true(labelling, candidates, plain)


def test_too_few_candidates_are_refused_with_a_hint(plain: Any) -> None:
    """Four places are not enough to tell marks apart."""
    candidates = find_saddles(plain.image).take(np.arange(4))
    with pytest.raises(MarksNotFound, match="only 4 places") as caught:
        _label(candidates, plain)
    assert caught.value.hint


def test_random_candidates_are_no_leg(plain: Any) -> None:
    """Ten places drawn at random with random edges are refused, not labelled."""
    rng = np.random.default_rng(1)
    first = rng.uniform(0.0, np.pi, 10)
    random = Candidates(
        rng.uniform([20, 20], [740, 550], (10, 2)),
        np.full(10, 50.0),
        np.stack([first, first + rng.uniform(0.8, 2.3, 10)], axis=1),
    )
    with pytest.raises(MarksNotFound, match="none of the poses"):
        _label(random, plain, rounds=3)


def test_named_marks_give_the_view_in_spite_of_a_wrong_name(plain: Any) -> None:
    """With one of seven names wrong, the view still predicts all marks within 2 px."""
    names = ("P1", "P2", "P3", "P5", "P6", "P8", "P10")
    named = {n: plain.truth(n) for n in names}
    named["P3"] = plain.truth("P7")
    view = view_of_named(named, plain.leg, plain.view.intrinsics)
    assert view is not None
    off = np.linalg.norm(
        view.pixels(plain.leg.points()) - plain.view.pixels(plain.leg.points()), axis=1
    )
    assert off.max() < 2.0
    assert view_of_named({"P1": named["P1"]}, plain.leg, plain.view.intrinsics) is None
