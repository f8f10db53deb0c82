"""Scenes of the leg from geometry alone: a true camera, a true pose, and the marks seen.

The camera stands where the paper's cell has it, near the leg, and sees all ten marks.
"""

from dataclasses import dataclass, replace

import numpy as np

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
SETS = {
    "best seven": ("P1", "P2", "P3", "P5", "P6", "P8", "P10"),
    "ten": LEG.names(),
    "6+1": ("P1", "P2", "P3", "P4", "P5", "P6", "P10"),
}
COPLANAR = ("P2", "P3", "P4", "P5", "P6", "P7", "P10")
SIGMAS = (0.25, 0.5, 1.0)


@dataclass(frozen=True)
class Scene:
    """What is true, and the problem with free intrinsics that the noisy marks make of it."""

    camera: Intrinsics
    pose: Array
    problem: Problem

    @property
    def known(self) -> Problem:
        """Return the problem with the intrinsics exactly known."""
        return replace(self.problem, known=KnownIntrinsics(self.camera))

    def of(self, known: bool) -> Problem:
        """Return the problem with known or free intrinsics."""
        return self.known if known else self.problem

    def genes(self, known: bool) -> Array:
        """Return the true genes (11,); f is 1 where known, 5 where free."""
        f = 1.0 if known else 5.0
        c, angles = self.camera, angles_from_rotation(self.pose[:3, :3])
        return np.array([f, c.alpha_u / f, c.alpha_v / f, c.u0, c.v0, *self.pose[:3, 3], *angles])

    def errors(self, pose: Array) -> tuple[float, float]:
        """Return a pose's error: rotation in deg, translation in mm."""
        turned = np.degrees(angle_between(self.pose[:3, :3], pose[:3, :3]))
        return float(turned), float(np.linalg.norm(self.pose[:3, 3] - pose[:3, 3]))

    def station_error(self, pose: Array) -> float:
        """Return how far a pose puts the worst station from where it is, mm."""
        off = (pose - self.pose)[:3, :3] @ STATIONS.T + (pose - self.pose)[:3, 3:]
        return float(np.linalg.norm(off, axis=0).max())


def scene(
    seed: tuple[int, ...], names: tuple[str, ...], sigma: float, noise: float | None = None
) -> Scene:
    """Return a random camera that sees all ten marks; `noise` px is `sigma` unless given."""
    rng = np.random.default_rng(seed)
    while True:
        alpha = rng.uniform(560.0, 720.0)
        camera = Intrinsics(
            alpha,
            alpha * rng.uniform(0.98, 1.02),
            rng.uniform(310.0, 350.0),
            rng.uniform(260.0, 310.0),
        )
        pose = random_pose(rng)
        if all_seen(camera, pose):
            return seen(camera, pose, names, sigma, rng, noise)


def random_pose(rng: np.random.Generator) -> Array:
    """Return a camera_from_object of a camera near the leg, before its big face and side."""
    eye = rng.uniform([-75.0, -150.0, 5.0], [-25.0, -85.0, 70.0])
    target = rng.uniform([50.0, -12.0, -10.0], [75.0, 12.0, 10.0])
    roll = rotation_from_angles([0.0, 0.0, rng.uniform(-0.2, 0.2)])
    return transform(roll, np.zeros(3)) @ invert(look_at(eye, target))


def facing(pose: Array) -> Array:
    """Return the cosine (10,) between each mark's normal and the way to the camera."""
    names = LEG.names()
    eye = invert(pose)[:3, 3]
    faces = np.array([LEG.on_face(n) for n in names])
    side = LEG.surface_normal(np.array([LEG.mark_angle(n) for n in names]))
    normals = np.where(faces[:, None], [-1.0, 0.0, 0.0], side)
    sight = eye - LEG.points()
    return np.asarray(np.sum(normals * sight, axis=1) / np.linalg.norm(sight, axis=1))


def all_seen(camera: Intrinsics, pose: Array) -> bool:
    """Say whether all ten marks face the camera and lie in its picture."""
    pixels = project(camera, pose, LEG.points())
    return bool((facing(pose) > 0.15).all() and camera.sees(pixels, margin=6.0).all())


def seen(
    camera: Intrinsics,
    pose: Array,
    names: tuple[str, ...],
    sigma: float,
    rng: np.random.Generator,
    noise: float | None = None,
) -> Scene:
    """Return the scene of a camera and a pose with noise of `sigma` px, or of `noise`."""
    points = LEG.points(names)
    pixels = project(camera, pose, points)
    pixels = pixels + rng.normal(0.0, 1.0, pixels.shape) * (sigma if noise is None else noise)
    size = (camera.width, camera.height)
    problem = Problem(
        names, points, pixels, np.full(len(names), sigma), stations=STATIONS, size=size
    )
    return Scene(camera, pose, problem)
