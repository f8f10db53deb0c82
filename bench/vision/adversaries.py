"""Pictures drawn to mislead, by kind: each a pair, what the cell believes, and what is true.

A kind is a function of a Generator that gives a Case; bench.vision.kinds lists them.
"""

from dataclasses import replace

import cv2
import numpy as np

from bench.vision.cases import Case, shown, usual
from bench.vision.clutter import covers_over, left_in_sight, reflections, with_checkers
from bench.vision.legs import moved_marks, on_cone, scaled
from bench.vision.scenes import (
    LEG,
    Truth,
    camera_from_world,
    drawn,
    in_sight,
    renderer,
    settings,
    sharp,
    true_camera,
)
from bench.vision.spoil import Spoil, expose
from legato.geometry.transforms import rotation_from_vector, transform


def fair(rng: np.random.Generator) -> Case:
    """Draw the simulated cell as shipped."""
    return shown(drawn(rng), Spoil(), rng)


def fair_varied(rng: np.random.Generator) -> Case:
    """Draw twice the cell's scatter, seven sound marks in sight; other lens, light and sensor."""
    slant = (rng.uniform(0.0, 0.3), rng.uniform(0.0, 2.0 * np.pi))
    truth = drawn(rng, 2.0)
    while len(seen := in_sight(truth, true_camera())) < 7 or not {"P1", "P8"} & set(seen):
        truth = drawn(rng, 2.0)
    return shown(truth, replace(usual(rng), slant=slant), rng)


def hidden(rng: np.random.Generator) -> Case:
    """Draw none to five marks covered whole, and one more in part."""
    truth = drawn(rng, 1.5)
    return shown(
        truth, replace(usual(rng), covers=covers_over(truth, rng, int(rng.integers(0, 6)), 1)), rng
    )


def covered_in_part(rng: np.random.Generator) -> Case:
    """Draw one to eight marks each covered in part."""
    truth = drawn(rng, 1.5)
    return shown(
        truth, replace(usual(rng), covers=covers_over(truth, rng, 0, int(rng.integers(1, 9)))), rng
    )


def glare(rng: np.random.Generator) -> Case:
    """Draw reflections over one to six marks, some of them in part."""
    truth = drawn(rng, 1.5)
    glares = reflections(truth, rng, int(rng.integers(1, 7)))
    return shown(truth, replace(usual(rng), glares=glares), rng)


def misplaced(rng: np.random.Generator) -> Case:
    """Draw one to four marks pasted 2 to 10 mm beside their places."""
    names = rng.choice(LEG.names(), int(rng.integers(1, 5)), replace=False)
    moves = {}
    for n in names:
        size, angle = rng.uniform(2.0, 10.0), rng.uniform(0.0, 2.0 * np.pi)
        moves[str(n)] = (size * np.cos(angle), size * np.sin(angle))
    return shown(drawn(rng, 1.0, moved_marks(moves)), usual(rng), rng)


def sloppy(rng: np.random.Generator) -> Case:
    """Draw every mark pasted beside its place by 0.1 to 1.5 mm."""
    size = rng.uniform(0.1, 1.5)
    moves = {n: tuple(rng.normal(0.0, size, 2)) for n in LEG.names()}
    return shown(drawn(rng, 1.0, moved_marks(moves)), usual(rng), rng)


def slipped(rng: np.random.Generator) -> Case:
    """Draw a strip of marks pasted as one sheet, shifted or turned as a whole by 0.5 to 6 mm."""
    strips = (("P5", "P6", "P7", "P10"), ("P2", "P3", "P4", "P9"), ("P1", "P8"))
    sheets = rng.choice(3, int(rng.integers(1, 3)), replace=False)
    moves = {}
    for k in sheets:
        size, angle = rng.uniform(0.5, 6.0), rng.uniform(0.0, 2.0 * np.pi)
        for n in strips[k]:
            moves[n] = (size * np.cos(angle), size * np.sin(angle))
    return shown(drawn(rng, 1.0, moved_marks(moves)), usual(rng), rng)


def other_cone(rng: np.random.Generator) -> Case:
    """Draw a leg of other radii or length, marked with the same template."""
    big, small = 30.5 * rng.uniform(0.9, 1.1), 9.75 * rng.uniform(0.7, 1.3)
    return shown(
        drawn(rng, 1.0, on_cone(big, small, 194.0 * rng.uniform(0.9, 1.1))), usual(rng), rng
    )


def scaled_leg(rng: np.random.Generator) -> Case:
    """Draw a leg of 0.9 to 1.1 times the size, with marks of the right size on it."""
    return shown(drawn(rng, 1.0, scaled(rng.uniform(0.9, 1.1), 8.0)), usual(rng), rng)


def scaled_with_marks(rng: np.random.Generator) -> Case:
    """Draw a leg of 0.9 to 1.1 times the size, its marks too: the same picture from farther."""
    return _rescaled(rng, rng.uniform(0.9, 1.1))


def scaled_far_with_marks(rng: np.random.Generator) -> Case:
    """Draw a leg of 0.6 to 0.85 or 1.25 to 1.6 times the size, its marks too, on the table."""
    return _rescaled(rng, rng.uniform(*((0.6, 0.85), (1.25, 1.6))[int(rng.integers(2))]))


def _rescaled(rng: np.random.Generator, by: float) -> Case:
    """Return a leg so many times as large with all that is on it; it rests where the leg would."""
    truth = drawn(rng, 1.0, scaled(by, 8.0 * by))
    place = truth.world_from_object.copy()
    place[2, 3] += LEG.big_radius * (by - 1.0)
    return shown(replace(truth, world_from_object=place), usual(rng), rng)


def mirrored(rng: np.random.Generator) -> Case:
    """Draw pictures that a driver flipped or turned: a mirror image of the leg.

    (The ten marks are symmetric about a plane at 67.5 deg: a mirrored leg is the leg itself.)
    """
    case = shown(drawn(rng), usual(rng), rng)
    code = int(rng.choice([-1, 0, 1]))
    first, second = (
        np.asarray(cv2.flip(i, code), dtype=np.uint8) for i in (case.first, case.second)
    )
    return replace(case, first=first, second=second)


def one_mark_elsewhere(rng: np.random.Generator) -> Case:
    """Draw P1 or P8 pasted 0.3 to 3 mm beside its place: they hold the pose off its plane."""
    size, angle = rng.uniform(0.3, 3.0), rng.uniform(0.0, 2.0 * np.pi)
    move = (size * np.cos(angle), size * np.sin(angle))
    which = ("P1", "P8") if rng.random() < 0.3 else (str(rng.choice(["P1", "P8"])),)
    return shown(drawn(rng, 1.0, moved_marks(dict.fromkeys(which, move))), usual(rng), rng)


LEAST_SEEN = 6  # marks of a leg that can be found at all


def second_leg(rng: np.random.Generator) -> Case:
    """Draw another leg model beside the true one, marks of both covered.

    A leg of which fewer than six marks show cannot be found at all: then the other one counts.
    """
    truth, other = drawn(rng), drawn(rng)
    shift = np.array([rng.uniform(-90.0, 60.0), rng.uniform(-50.0, 90.0), rng.uniform(0.0, 60.0)])
    turn = rotation_from_vector([0.0, 0.0, rng.uniform(-0.6, 0.6)])
    place = transform(
        turn @ other.world_from_object[:3, :3], other.world_from_object[:3, 3] + shift
    )
    other = replace(other, world_from_object=place)
    far, near = sorted((truth, other), key=lambda t: -_depth(t))
    scene = sharp(near, true_camera(), sharp(far, true_camera()))
    covers = covers_over(truth, rng, int(rng.integers(0, 5)), 0)
    covers += covers_over(other, rng, int(rng.integers(0, 5)), 0)
    first, second = (expose(scene, s, rng) for s in [replace(usual(rng), covers=covers)] * 2)
    alone = len(left_in_sight(truth, covers, near)) < LEAST_SEEN
    return Case(first, second, settings(), truth, other if alone else None)


def no_leg(rng: np.random.Generator) -> Case:
    """Draw black, white, even, noisy, or the cell without a leg but with checkers all over."""
    kind = int(rng.integers(0, 5))
    size = (576, 768)
    if kind == 4:
        truth = drawn(rng)
        pose = camera_from_world() @ truth.world_from_object
        scene = renderer(truth, true_camera()).scenery(pose, camera_from_world())
        scene = with_checkers(scene, rng, int(rng.integers(5, 40)))
        first, second = (expose(scene, usual(rng), rng) for _ in range(2))
        return Case(first, second, settings(), None)
    if kind == 3:
        image = rng.integers(0, 256, size, dtype=np.uint8)
        if rng.random() < 0.5:
            image = np.asarray(cv2.GaussianBlur(image, (0, 0), rng.uniform(1.0, 4.0)))
    else:
        image = np.full(size, (0, 255, int(rng.integers(1, 255)))[kind], dtype=np.uint8)
    return Case(image, image, settings(), None)


def bad_exposure(rng: np.random.Generator) -> Case:
    """Draw an exposure too long up to nine times, or under-exposed down to a fiftieth."""
    gain = rng.uniform(1.2, 9.0) if rng.random() < 0.5 else float(np.exp(rng.uniform(-3.9, -0.4)))
    return shown(drawn(rng), replace(usual(rng), gain=gain), rng)


def out_of_focus(rng: np.random.Generator) -> Case:
    """Draw a blur, Gauss or disc, of 1 to 8 px, with a sensor's noise up to 8 levels."""
    spoil = Spoil(noise=rng.uniform(1.0, 8.0))
    if rng.random() < 0.5:
        spoil = replace(spoil, blur=rng.uniform(1.0, 6.0))
    else:
        spoil = replace(spoil, defocus=rng.uniform(1.0, 8.0))
    return shown(drawn(rng), spoil, rng)


def motion_blur(rng: np.random.Generator) -> Case:
    """Draw a straight motion of 1 to 20 px while the shutter is open."""
    motion = (rng.uniform(1.0, 20.0), rng.uniform(0.0, np.pi))
    return shown(drawn(rng), replace(usual(rng), motion=motion), rng)


def compressed(rng: np.random.Generator) -> Case:
    """Draw a JPEG of quality 10 to 90."""
    return shown(drawn(rng), replace(usual(rng), jpeg=int(rng.integers(10, 91))), rng)


def _depth(truth: Truth) -> float:
    pose = camera_from_world() @ truth.world_from_object
    return float((pose[:3, :3] @ [97.0, 0.0, 0.0] + pose[:3, 3])[2])
