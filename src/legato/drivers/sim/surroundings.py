"""What the simulated camera sees around the leg: lamp, table with the leg's shadow, wall.

Textures are fixed sums of waves, so the same scene always looks the same.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from legato.geometry.leg import Leg
from legato.geometry.raycast import cast
from legato.geometry.transforms import Array, apply, invert

TABLE_REACH = 700.0  # mm from the world's origin to the table's far edge
Picture = NDArray[np.float32]
COARSE = 2  # the shadow is cast once for so many pixels along each side


@dataclass(frozen=True)
class Light:
    """A distant lamp and the light of the room; `toward` points to the lamp in the world."""

    toward: tuple[float, float, float] = (0.62, -0.45, 0.65)
    ambient: float = 0.42
    diffuse: float = 0.6

    def direction(self) -> Array:
        """Return the unit vector (3,) toward the lamp in the world."""
        v = np.asarray(self.toward, dtype=float)
        return np.asarray(v / np.linalg.norm(v))

    def on(self, normals: Array, lamp: Array) -> Array:
        """Return the light (...) on surfaces of normals (..., 3), Lambert, in `lamp`'s frame."""
        return np.asarray(self.ambient + self.diffuse * np.maximum(normals @ lamp, 0.0))


class Surroundings:
    """Table and wall as one camera sees them, kept while the camera stands still.

    `normalised` (H, W, 2) are the pixels' undistorted image coordinates, `table_z` in mm.
    """

    def __init__(self, leg: Leg, light: Light, normalised: Array, table_z: float) -> None:
        self._leg = leg
        self._light = light
        self._normalised = normalised
        self._table_z = table_z
        self._key = b""

    def picture(self, camera_from_world: Array, object_from_world: Array) -> Picture:
        """Return the picture (H, W) without the leg, but with its shadow on the table."""
        if camera_from_world.tobytes() != self._key:
            self._look(camera_from_world)
            self._key = camera_from_world.tobytes()
        shadow = self._shadow(object_from_world)
        return np.asarray(np.where(shadow, self._shaded, self._lit), dtype=np.float32)

    def _look(self, camera_from_world: Array) -> None:
        """Work out what does not depend on the leg: table points, and both brightnesses."""
        n = self._normalised
        world_from_camera = invert(camera_from_world)
        eye, r = world_from_camera[:3, 3], world_from_camera[:3, :3]
        rays = n[..., :1] * r[:, 0] + n[..., 1:] * r[:, 1] + r[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (self._table_z - eye[2]) / rays[..., 2]
            places = eye + distance[..., None] * rays
            on_table = (distance > 0.0) & (np.hypot(places[..., 0], places[..., 1]) < TABLE_REACH)
        places[~on_table] = 0.0
        wall, table = _wall(rays), _table(places[..., 0], places[..., 1])
        light = self._light
        lit = light.ambient + light.diffuse * max(light.direction()[2], 0.0)
        self._lit = np.where(on_table, table * lit, wall)
        self._shaded = np.where(on_table, table * light.ambient, wall)
        self._places = places[::COARSE, ::COARSE]

    def _shadow(self, object_from_world: Array) -> NDArray[np.bool_]:
        """Say (H, W) which table points the leg keeps from the lamp."""
        origins = apply(object_from_world, self._places)
        direction = object_from_world[:3, :3] @ self._light.direction()
        dark = cast(self._leg, origins, direction).hit.astype(np.uint8)
        size = self._normalised.shape[1::-1]
        return np.asarray(cv2.resize(dark, size, interpolation=cv2.INTER_NEAREST) > 0)


def _table(x: Array, y: Array) -> Array:
    """Return the table's reflectance: planks 90 mm wide with a fine figure."""
    plank = np.floor((x + 31.0) / 90.0)
    seam = np.abs((x + 31.0) / 90.0 - plank - 0.5) > 0.49
    figure = np.sin(0.31 * x + 1.7 * plank + 0.6 * np.sin(0.021 * y + plank))
    tone = 0.36 + 0.03 * np.sin(12.9 * plank) + 0.015 * figure
    return np.where(seam, 0.22, tone)


def _wall(rays: Array) -> Array:
    """Return the wall's brightness by ray: cupboards and a bright window, out of focus."""
    bearing = np.arctan2(rays[..., 1], rays[..., 0])
    height = rays[..., 2] / np.hypot(rays[..., 0], rays[..., 1])
    cupboards = 0.10 * np.tanh(8.0 * np.sin(7.0 * bearing + 0.4))
    window = 0.25 / (1.0 + np.exp(-40.0 * (np.cos(3.0 * bearing + 1.0) - 0.75)))
    return np.asarray(0.38 + cupboards + window + 0.15 * np.clip(height, -1.0, 1.0))
