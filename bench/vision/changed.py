"""Pairs of pictures that are sound, while the cell believes wrongly or something moves between."""

from dataclasses import replace

import numpy as np

from bench.vision.cases import Case, shown, usual
from bench.vision.clutter import covers_over, mark_pixels
from bench.vision.scenes import (
    Sharp,
    Truth,
    camera_from_world,
    drawn,
    renderer,
    settings,
    sharp,
    true_camera,
)
from bench.vision.spoil import Spoil, expose
from legato.control.settings import CellSettings
from legato.geometry.projection import Intrinsics
from legato.geometry.transforms import Array, rotation_from_vector, transform


def wrong_camera(rng: np.random.Generator) -> Case:
    """Draw an intrinsics file wrong by up to 5 % in alpha and 20 px in the principal point."""
    return shown(drawn(rng), usual(rng), rng, _believing(rng))


def wrong_camera_five(rng: np.random.Generator) -> Case:
    """Draw an intrinsics file wrong by just 5 % in alpha, up or down, and right in all else."""
    return shown(drawn(rng), usual(rng), rng, _scaled_alpha(rng.choice([0.95, 1.05])))


def wrong_camera_little(rng: np.random.Generator) -> Case:
    """Draw an intrinsics file wrong by up to 1.5 % in alpha and 6 px in the principal point."""
    return shown(drawn(rng), usual(rng), rng, _believing(rng, 0.3))


def wrong_camera_hidden(rng: np.random.Generator) -> Case:
    """Draw the same, with one to three marks covered."""
    truth = drawn(rng)
    spoil = replace(usual(rng), covers=covers_over(truth, rng, int(rng.integers(1, 4)), 0))
    return shown(truth, spoil, rng, _believing(rng))


def wrong_camera_spoilt(rng: np.random.Generator) -> Case:
    """Draw the same, in a noisy, blurred or compressed picture."""
    spoil = Spoil(blur=rng.uniform(0.8, 2.5), noise=rng.uniform(2.0, 8.0))
    if rng.random() < 0.5:
        spoil = replace(spoil, jpeg=int(rng.integers(40, 91)))
    return shown(drawn(rng), spoil, rng, _believing(rng))


def free_camera(rng: np.random.Generator) -> Case:
    """Draw free intrinsics: all marks, or up to three of them covered."""
    truth = drawn(rng)
    spoil = replace(usual(rng), covers=covers_over(truth, rng, int(rng.integers(0, 4)), 0))
    return shown(truth, spoil, rng, settings("free"))


def swapped_picks(rng: np.random.Generator) -> Case:
    """Draw a person's picks of six to ten marks, two to four names in each other's places."""
    case = shown(drawn(rng), usual(rng), rng)
    assert case.truth is not None
    pixels = mark_pixels(case.truth)
    names = [str(n) for n in rng.permutation(list(pixels))[: int(rng.integers(6, 11))]]
    count = min(int(rng.integers(2, 5)), len(names))
    named = dict(zip(names, names, strict=True))
    named |= dict(zip(names[:count], [*names[1:count], names[0]], strict=True))
    picks = {}
    for name, at in named.items():
        u, v = pixels[at] + rng.uniform(-6.0, 6.0, 2)
        picks[name] = (float(u), float(v))
    return replace(case, picks=picks)


def moved_between(rng: np.random.Generator) -> Case:
    """Draw a leg moved by 0.2 to 20 mm or 0.2 to 10 deg between the two pictures."""
    before = drawn(rng)
    away, about = (_direction(rng) for _ in range(2))
    size, angle = np.exp(rng.uniform(np.log([0.2, 0.2]), np.log([20.0, 10.0])))
    which = int(rng.integers(0, 3))
    shift = away * size * (which != 1)
    turn = rotation_from_vector(about * np.radians(angle) * (which != 0))
    middle = before.world_from_object[:3, 3] + 97.0 * before.world_from_object[:3, 0]
    motion = transform(turn, middle + shift - turn @ middle)
    after = replace(before, world_from_object=motion @ before.world_from_object)
    spoil, camera = usual(rng), true_camera()
    first, second = (expose(sharp(t, camera), spoil, rng) for t in (before, after))
    return Case(first, second, settings(), after)


def camera_bumped_between(rng: np.random.Generator) -> Case:
    """Draw a camera moved by up to 5 mm and 2 deg between the two pictures: they disagree."""
    truth, spoil, bumped = drawn(rng), usual(rng), _bump(rng)
    first = expose(sharp(truth, true_camera()), spoil, rng)
    second = expose(_seen_from(truth, bumped @ camera_from_world()), spoil, rng)
    # The arm goes by the first picture, which is right: an acceptance is no error of the pose.
    return Case(first, second, settings(), truth)


def camera_bumped_before(rng: np.random.Generator) -> Case:
    """Draw a camera moved by up to 5 mm and 2 deg since the cell was measured."""
    truth, spoil = drawn(rng), usual(rng)
    scene = _seen_from(truth, _bump(rng) @ camera_from_world())
    first, second = (expose(scene, spoil, rng) for _ in range(2))
    return Case(first, second, settings(), truth)


def _believing(rng: np.random.Generator, part: float = 1.0) -> CellSettings:
    """Return settings with a camera wrong by up to 5 % and 20 px, believed as well as the true."""
    base = settings()
    assert base.known is not None
    i = base.known.intrinsics
    share, aspect = rng.uniform(-0.05, 0.05), rng.uniform(-0.01, 0.01) * (rng.random() < 0.3)
    off = rng.uniform(-20.0, 20.0, 2)
    which = int(rng.integers(0, 3))
    share, off = part * share * (which != 1), part * off * (which != 0)
    wrong = Intrinsics(
        i.alpha_u * (1 + share + aspect), i.alpha_v * (1 + share - aspect),
        i.u0 + off[0], i.v0 + off[1], i.k1, i.k2, i.width, i.height,
    )  # fmt: skip
    return replace(base, nominal=wrong, known=replace(base.known, intrinsics=wrong))


def _scaled_alpha(by: float) -> CellSettings:
    """Return settings with a camera whose focal length is so many times the true one."""
    base = settings()
    assert base.known is not None
    i = base.known.intrinsics
    wrong = replace(i, alpha_u=i.alpha_u * by, alpha_v=i.alpha_v * by)
    return replace(base, nominal=wrong, known=replace(base.known, intrinsics=wrong))


def _direction(rng: np.random.Generator) -> Array:
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))


def _bump(rng: np.random.Generator) -> Array:
    """Return a small motion of the camera, after_from_before."""
    turn = rotation_from_vector(_direction(rng) * np.radians(rng.uniform(0.1, 2.0)))
    return transform(turn, _direction(rng) * rng.uniform(0.1, 5.0))


def _seen_from(truth: Truth, from_world: Array) -> Sharp:
    return renderer(truth, true_camera()).sharp(from_world @ truth.world_from_object, from_world)
