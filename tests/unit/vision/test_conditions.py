"""Marks in pictures as cameras make them: cluttered, covered, unevenly lit, moved, compressed.

The benches draw hundreds of each kind; here a few hold the behaviour.
"""

from dataclasses import replace

import numpy as np
import pytest

from bench.vision.clutter import hiding, reflections, with_checkers
from bench.vision.scenes import (
    LEG,
    Truth,
    anywhere,
    camera_from_world,
    drawn,
    in_sight,
    of_size,
    renderer,
    settings,
    sharp,
    true_camera,
)
from bench.vision.spoil import Spoil, expose
from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, project
from legato.hal.camera import Image
from legato.vision.marks import MarksNotFound, Picking
from legato.vision.pick import find_marks

SIGMAS = 5.0  # no mark may be further off than so many of its own sigmas


def look(
    image: Image, truth: Truth, camera: Intrinsics, believed: Intrinsics | None = None
) -> tuple[Picking, dict[str, float]]:
    """Return the picking, and each mark's error in its own sigmas."""
    picking = find_marks(image, LEG, believed or camera)
    pose = camera_from_world() @ truth.world_from_object
    places = dict(zip(LEG.names(), project(camera, pose, truth.leg.points()), strict=True))
    errors = {
        n: float(np.hypot(*(places[n] - (m.u, m.v))) / m.sigma) for n, m in picking.marks.items()
    }
    return picking, errors


CONDITIONS = {
    "light falls off by 60 %": Spoil(slant=(0.6, 2.0)),
    "over-exposed by a third": Spoil(gain=1.33),
    "under-exposed to a third": Spoil(gain=0.33),
    "noise of 5 levels": Spoil(noise=5.0),
    "blur of 2 px": Spoil(blur=2.0),
    "motion of 4 px": Spoil(motion=(4.0, 0.7)),
    "JPEG 60": Spoil(jpeg=60),
}


@pytest.mark.parametrize("name", CONDITIONS)
def test_marks_are_found_and_their_sigmas_are_honest(name: str) -> None:
    """A spoilt picture costs a mark or two at most, and no mark lies beyond five sigmas."""
    rng = np.random.default_rng(11)
    truth, camera = drawn(rng, 1.5), true_camera()
    image = expose(sharp(truth, camera), CONDITIONS[name], rng)
    picking, errors = look(image, truth, camera)
    assert len(picking.marks) >= len(in_sight(truth, camera)) - 2
    assert max(errors.values()) < SIGMAS


@pytest.mark.parametrize("size", [(640, 480), (1280, 960)])
def test_sensors_of_other_sizes_do(size: tuple[int, int]) -> None:
    """The same scene on a smaller or larger sensor gives all marks in sight."""
    rng = np.random.default_rng(12)
    truth, camera = drawn(rng), true_camera(*size)
    image = expose(sharp(truth, camera), Spoil(), rng)
    picking, errors = look(image, truth, camera, of_size(settings(), *size).nominal)
    assert len(picking.marks) >= 9
    assert max(errors.values()) < SIGMAS


def test_clutter_does_not_mislead() -> None:
    """Twenty checkers on the table and wall take no mark's place."""
    rng = np.random.default_rng(13)
    truth, camera = drawn(rng), true_camera()
    pose, world = camera_from_world() @ truth.world_from_object, camera_from_world()
    behind = with_checkers(renderer(truth, camera).scenery(pose, world), rng, 20)
    picking, errors = look(expose(sharp(truth, camera, behind), Spoil(), rng), truth, camera)
    assert len(picking.marks) >= 9
    assert max(errors.values()) < SIGMAS


def test_three_hidden_marks_are_done_without() -> None:
    """Of ten marks in sight three are covered: the other seven are found."""
    rng = np.random.default_rng(14)
    truth, camera = anywhere(rng, true_camera(), 10), true_camera()
    covers = hiding(truth, rng, 3)
    picking, errors = look(expose(sharp(truth, camera), Spoil(covers=covers), rng), truth, camera)
    assert len(picking.marks) >= 6
    assert max(errors.values()) < SIGMAS


@pytest.mark.parametrize("seed", range(4))
def test_glare_costs_marks_but_moves_none(seed: int) -> None:
    """Reflections over three marks hide them or leave them in place, within their sigmas."""
    rng = np.random.default_rng(seed)
    truth, camera = drawn(rng), true_camera()
    spoil = Spoil(glares=reflections(truth, rng, 3))
    try:
        _, errors = look(expose(sharp(truth, camera), spoil, rng), truth, camera)
    except MarksNotFound:
        return
    assert max(errors.values()) < SIGMAS


@pytest.mark.parametrize("by", [0.96, 1.0, 1.05])
def test_the_marks_size_tells_the_legs(by: float) -> None:
    """On a leg of another size, farther or nearer, printed marks look too large or too small."""
    rng = np.random.default_rng(15)
    marks = {n: (x * by, y * by, z * by) for n, (x, y, z) in LEG.marks.items()}
    leg = Leg(LEG.big_radius * by, LEG.small_radius * by, LEG.length * by, marks)
    truth, camera = drawn(rng, 1.0, leg), true_camera()
    picking = find_marks(expose(sharp(truth, camera), Spoil(), rng), LEG, camera)
    size, sigma = np.array([(m.size, m.size_sigma) for m in picking.marks.values()]).T
    mean = float(sigma**-2.0 @ size / np.sum(sigma**-2.0))
    assert mean == pytest.approx(1.0 / by, abs=0.002)
    assert (np.abs(size - 1.0 / by) < 5.0 * sigma + 0.003).all()


def test_an_outline_that_is_covered_has_no_size() -> None:
    """A mark without wood in sight around it gives a place but no size."""
    from legato.vision.size import UNKNOWN, measure_size
    from legato.vision.template import make_template
    from legato.vision.view import View

    rng = np.random.default_rng(16)
    truth, camera = drawn(rng), true_camera()
    view = View(camera, camera_from_world() @ truth.world_from_object)
    template = make_template(LEG, view, "P5", 1)
    assert template is not None
    patch = np.full(template.shape, 100.0)
    nothing = np.zeros(template.shape, dtype=bool)
    assert measure_size(template, patch, nothing, np.zeros(2), 0.0, 1.0) == UNKNOWN


def test_marks_clipped_on_one_side_are_left_out() -> None:
    """A glare that ends on a mark leaves only a part of it: the mark is missing, not displaced."""
    rng = np.random.default_rng(17)
    truth, camera = drawn(rng), true_camera()
    pose = camera_from_world() @ truth.world_from_object
    at = project(camera, pose, LEG.points(("P2",)))[0]
    image = expose(sharp(truth, camera), Spoil(), rng)
    v, u = np.mgrid[0 : image.shape[0], 0 : image.shape[1]]
    bright = np.where(u < at[0] + 2.0, 3.0, 0.0) * np.exp(-(((u - at[0]) / 40.0) ** 2))
    near = np.hypot(u - at[0], v - at[1]) < 60.0
    lit = np.clip(image * (1.0 + bright * near), 0.0, 255.0).astype(np.uint8)
    picking, errors = look(lit, replace(truth), camera)
    assert "P2" in picking.missing or errors["P2"] < SIGMAS
