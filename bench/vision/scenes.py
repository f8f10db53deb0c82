"""The simulated cell's pictures with their truth: which leg lies where, before which camera.

What the cell believes is the shipped configuration; what is true may differ from it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache

import msgspec
import numpy as np
from numpy.typing import NDArray

from legato.calibration.problem import KnownIntrinsics
from legato.config.build import cell_settings
from legato.config.load import load, shipped
from legato.control.settings import CellSettings
from legato.drivers.sim.render import PastedMark, Renderer, paste_marks
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import drawn_pose
from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, project
from legato.geometry.raycast import facing
from legato.geometry.transforms import Array, invert, look_at, rotation_from_vector, transform

Sharp = NDArray[np.float32]
LEG = Leg()


@cache
def sim() -> SimSettings:
    """Return what is true in the shipped simulated cell."""
    return load(shipped("sim.toml")).config.sim


@cache
def settings(intrinsics: str = "known") -> CellSettings:
    """Return what the shipped simulated cell believes, with known or free intrinsics."""
    loaded = load(shipped("sim.toml"))
    table = msgspec.structs.replace(loaded.config.calibration, intrinsics=intrinsics)
    config = msgspec.structs.replace(loaded.config, calibration=table)
    return cell_settings(replace(loaded, config=config))


def true_camera(width: int = 768, height: int = 576) -> Intrinsics:
    """Return the simulated camera with another sensor: as high a field, and as wide as it gets."""
    s, by = sim(), height / 576.0
    u0 = (s.u0 + 0.5) * by - 0.5 + (width - 768.0 * by) / 2.0
    v0 = (s.v0 + 0.5) * by - 0.5
    return Intrinsics(s.alpha_u * by, s.alpha_v * by, u0, v0, s.k1, s.k2, width, height)


def of_size(believed: CellSettings, width: int, height: int) -> CellSettings:
    """Return settings whose known camera has another sensor, as well known as the shipped one."""
    assert believed.known is not None
    i, by = believed.known.intrinsics, height / 576.0
    u0 = (i.u0 + 0.5) * by - 0.5 + (width - 768.0 * by) / 2.0
    v0 = (i.v0 + 0.5) * by - 0.5
    camera = Intrinsics(i.alpha_u * by, i.alpha_v * by, u0, v0, i.k1, i.k2, width, height)
    scale = np.diag([by, by, by, by, 1.0, 1.0])
    known = KnownIntrinsics(camera, scale @ believed.known.covariance @ scale)
    return replace(believed, nominal=camera, known=known)


def camera_from_world() -> Array:
    """Return where the world lies for the simulated camera."""
    s = sim()
    return invert(look_at(s.camera_at_mm, s.camera_looks_at_mm))


@dataclass(frozen=True)
class Truth:
    """One leg as it truly is and lies, and its marks as a hand pasted them."""

    leg: Leg
    world_from_object: Array
    marks: Mapping[str, PastedMark] = field(default_factory=dict)

    def stations(self) -> Array:
        """Return the stations (S, 3) on the leg's top line in the world."""
        places = self.leg.surface_point(np.array(settings().stations))
        return np.asarray(places @ self.world_from_object[:3, :3].T + self.world_from_object[:3, 3])


def drawn(rng: np.random.Generator, spread: float = 1.0, leg: Leg = LEG) -> Truth:
    """Draw a leg as the simulated cell does, or with so many times its scatter."""
    s = sim()
    wider = msgspec.structs.replace(
        s, scatter_mm=s.scatter_mm * spread, scatter_deg=s.scatter_deg * spread
    )
    return Truth(leg, drawn_pose(wider, rng), paste_marks(leg, s.mark_turn_deg, rng))


def anywhere(rng: np.random.Generator, camera: Intrinsics, least: int = 7) -> Truth:
    """Draw a leg over the workspace of which so many marks, P1 or P8 with them, are in sight."""
    while True:
        yaw, rise, roll = np.radians(rng.uniform([65.0, -1.0, -12.0], [115.0, 12.0, 12.0]))
        turn = (
            rotation_from_vector([0.0, 0.0, yaw])
            @ rotation_from_vector([0.0, -rise, 0.0])
            @ rotation_from_vector([roll, 0.0, 0.0])
        )
        at = rng.uniform([95.0, -90.0, 27.0], [150.0, -35.0, 40.0])
        truth = Truth(LEG, transform(turn, at), paste_marks(LEG, sim().mark_turn_deg, rng))
        seen = in_sight(truth, camera)
        if len(seen) >= least and {"P1", "P8"} & set(seen):
            return truth


def in_sight(truth: Truth, camera: Intrinsics, margin: float = 24.0) -> list[str]:
    """Return the marks that face the camera well and lie in its picture."""
    pose = camera_from_world() @ truth.world_from_object
    with np.errstate(invalid="ignore"):
        inside = camera.sees(project(camera, pose, truth.leg.points()), margin)
    names = truth.leg.names()
    return [n for n, i in zip(names, inside, strict=True) if i and facing(truth.leg, n, pose) > 0.2]


def sharp(truth: Truth, camera: Intrinsics, behind: Sharp | None = None) -> Sharp:
    """Return the picture of a leg before lens and sensor, laid over `behind` where given."""
    pose, world = camera_from_world() @ truth.world_from_object, camera_from_world()
    return renderer(truth, camera).sharp(pose, world, behind)


def renderer(truth: Truth, camera: Intrinsics) -> Renderer:
    """Return the renderer of one leg."""
    return Renderer(truth.leg, camera, truth.marks)
