"""Scenes of the leg as a camera near it sees them, from geometry alone."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from legato.calibration.problem import KnownIntrinsics, Problem
from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, project
from legato.geometry.transforms import (
    Array,
    angle_between,
    angles_from_rotation,
    invert,
    look_at,
    rotation_from_angles,
    transform,
)

LEG = Leg()
STATIONS = LEG.surface_point([7.0, 67.0, 127.0, 187.0])
TEN = LEG.names()
SEVEN = ("P1", "P2", "P3", "P5", "P6", "P8", "P10")
SIX_AND_ONE = ("P1", "P2", "P3", "P4", "P5", "P6", "P10")
COPLANAR = ("P2", "P3", "P4", "P5", "P6", "P7", "P10")

# Table 5.3: alpha_u, alpha_v, u0, v0, then the pose genes.
PAPER_POSES = {
    "a": (5.61 * 173.977, 5.61 * 179.6, 326.9, 308.4, -25.08, -14.54, 163.8, 1.662, 0.054, 0.64),
    "c": (5.23 * 181.79, 5.23 * 161.25, 324.5, 288.29, -24.8, -13.75, 149.33, 1.66, 0.397, 1.04),
    "d": (3.9 * 157.3, 3.9 * 148.7, 333.4, 256.2, -22.6, -3.14, 74.7, 1.71, 0.086, 0.705),
}


@dataclass(frozen=True)
class Scene:
    """A true camera and pose, and the problem that noisy marks make of them."""

    intrinsics: Intrinsics
    camera_from_object: Array
    problem: Problem

    def known(
        self, covariance: Array | None = None, intrinsics: Intrinsics | None = None
    ) -> Problem:
        """Return the problem with the intrinsics known."""
        camera = intrinsics or self.intrinsics
        c = np.zeros((6, 6)) if covariance is None else covariance
        return replace(self.problem, known=KnownIntrinsics(camera, c))

    def errors(self, camera_from_object: Array) -> tuple[float, float]:
        """Return the errors of a pose: rotation in rad, translation in mm."""
        turned = angle_between(self.camera_from_object[:3, :3], camera_from_object[:3, :3])
        moved = self.camera_from_object[:3, 3] - camera_from_object[:3, 3]
        return float(turned), float(np.linalg.norm(moved))


class Scenes:
    """Makes scenes; everything random comes from the seed."""

    ten, seven, six_and_one, coplanar = TEN, SEVEN, SIX_AND_ONE, COPLANAR
    leg, stations = LEG, STATIONS

    def paper(self, pose: str = "a", names: tuple[str, ...] = SEVEN, **options: Any) -> Scene:
        """Return one of the paper's poses."""
        au, av, u0, v0, *rest = PAPER_POSES[pose]
        place = transform(rotation_from_angles(rest[3:]), rest[:3])
        return self.seen(Intrinsics(au, av, u0, v0), place, names, **options)

    def random(self, seed: int, names: tuple[str, ...] = SEVEN, **options: Any) -> Scene:
        """Return a random camera that sees all ten marks, big face toward it."""
        rng = np.random.default_rng(seed)
        k1 = options.pop("k1", 0.0)
        while True:
            alpha = rng.uniform(560.0, 720.0)
            camera = Intrinsics(
                alpha,
                alpha * rng.uniform(0.98, 1.02),
                rng.uniform(310.0, 350.0),
                rng.uniform(260.0, 310.0),
                k1,
            )
            place = self.random_place(rng)
            if self.all_seen(camera, place):
                return self.seen(camera, place, names, seed=seed, **options)

    def random_place(self, rng: np.random.Generator) -> Array:
        """Return a random camera_from_object near the leg."""
        eye = rng.uniform([-75.0, -150.0, 5.0], [-25.0, -85.0, 70.0])
        target = rng.uniform([50.0, -12.0, -10.0], [75.0, 12.0, 10.0])
        roll = rotation_from_angles([0.0, 0.0, rng.uniform(-0.2, 0.2)])
        return transform(roll, np.zeros(3)) @ invert(look_at(eye, target))

    def all_seen(self, camera: Intrinsics, place: Array) -> bool:
        """Say whether all ten marks face the camera and lie in its picture."""
        eye = invert(place)[:3, 3]
        points = LEG.points()
        angles = np.array([LEG.mark_angle(n) for n in TEN])
        faces = np.array([LEG.on_face(n) for n in TEN])
        normals = np.where(faces[:, None], [-1.0, 0.0, 0.0], LEG.surface_normal(angles))
        sight = eye - points
        facing = np.sum(normals * sight, axis=1) / np.linalg.norm(sight, axis=1)
        pixels = project(camera, place, points)
        return bool((facing > 0.15).all() and camera.sees(pixels, margin=6.0).all())

    def seen(
        self,
        camera: Intrinsics,
        place: Array,
        names: tuple[str, ...],
        sigma: float = 0.25,
        noise: float | None = None,
        seed: int = 0,
    ) -> Scene:
        """Return the scene of a camera and a place; `noise` px is `sigma` unless given."""
        rng = np.random.default_rng([seed, 77])
        points = LEG.points(names)
        pixels = project(camera, place, points)
        pixels = pixels + rng.normal(0.0, 1.0, pixels.shape) * (sigma if noise is None else noise)
        problem = Problem(names, points, pixels, np.full(len(names), sigma), stations=STATIONS)
        return Scene(camera, place, problem)


def true_genes(scene: Scene) -> Array:
    """Return the genes (11,) of a scene's truth, f being 5."""
    i, place = scene.intrinsics, scene.camera_from_object
    angles = angles_from_rotation(place[:3, :3])
    return np.array([5.0, i.alpha_u / 5, i.alpha_v / 5, i.u0, i.v0, *place[:3, 3], *angles])


@pytest.fixture(scope="session")
def scenes() -> Scenes:
    """Return the maker of scenes."""
    return Scenes()


@pytest.fixture(scope="session")
def truth() -> Callable[[Scene], Array]:
    """Return the function that gives a scene's true genes."""
    return true_genes
