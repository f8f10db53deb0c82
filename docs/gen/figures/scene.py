"""The cell that the figures show: the paper's placement, the simulated camera, the leg's marks."""

from dataclasses import dataclass

import numpy as np

from legato.calibration.problem import GENES, PAPER_BOUNDS, KnownIntrinsics, Problem
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import drawn_pose
from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, project
from legato.geometry.transforms import Array, angles_from_rotation, invert, look_at

STATIONS = (7.0, 67.0, 127.0, 187.0)
ALL = tuple(Leg().names())
COPLANAR = ("P2", "P3", "P4", "P5", "P6", "P7", "P9", "P10")
SIX_AND_ONE = ("P1", "P2", "P3", "P5", "P6", "P9", "P10")
BEST_SEVEN = ("P1", "P2", "P3", "P5", "P6", "P8", "P10")


@dataclass(frozen=True)
class Scene:
    """Leg, camera and pose; `genes` (11,) are their true values for the estimator."""

    leg: Leg
    camera: Intrinsics
    world_from_camera: Array
    world_from_object: Array

    @property
    def camera_from_object(self) -> Array:
        """The pose that a calibration estimates."""
        return invert(self.world_from_camera) @ self.world_from_object

    @property
    def genes(self) -> Array:
        """The true genes, with f = 4 mm."""
        pose, camera = self.camera_from_object, self.camera
        first = [4.0, camera.alpha_u / 4.0, camera.alpha_v / 4.0, camera.u0, camera.v0]
        return np.array([*first, *pose[:3, 3], *angles_from_rotation(pose[:3, :3])])

    def problem(
        self,
        names: tuple[str, ...],
        sigma: float,
        rng: np.random.Generator | None = None,
        *,
        known: bool = False,
    ) -> Problem:
        """Return the marks as seen, with noise where there is a generator."""
        points = self.leg.points(names)
        pixels = project(self.camera, self.camera_from_object, points)
        if rng is not None:
            pixels = pixels + rng.normal(0.0, sigma, pixels.shape)
        return Problem(
            names=names,
            points=points,
            pixels=pixels,
            sigma=np.full(len(names), sigma),
            bounds=bounds(self.genes),
            known=KnownIntrinsics(self.camera) if known else None,
            stations=self.leg.surface_point(np.array(STATIONS)),
        )


def bounds(genes: Array) -> dict[str, tuple[float, float]]:
    """Return the paper's bounds, widened where the simulated camera needs it."""
    found = dict(PAPER_BOUNDS)
    for name, value in zip(GENES, genes, strict=True):
        low, high = found[name]
        found[name] = (min(low, float(value)), max(high, float(value)))
    return found


def scene() -> Scene:
    """Return the paper's placement as the simulated cell has it, without scatter or distortion."""
    true = SimSettings(scatter_mm=0.0, scatter_deg=0.0)
    camera = Intrinsics(true.alpha_u, true.alpha_v, true.u0, true.v0, 0.0, 0.0, 768, 576)
    pose = drawn_pose(true, np.random.default_rng(0))
    return Scene(Leg(), camera, look_at(true.camera_at_mm, true.camera_looks_at_mm), pose)
