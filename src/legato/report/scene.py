"""Where leg, camera and stations are by a record: the geometry that figures and score share.

Frames as everywhere: W robot base, C camera, O leg; mm and px.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, project
from legato.geometry.transforms import Array, apply, invert
from legato.records.record import SessionRecord

NEEDED = {"camera_from_object", "world_from_object", "alpha_u", "alpha_v", "u0", "v0"}


@dataclass(frozen=True)
class Scene:
    """One calibration: the leg, the camera, their poses (4x4), and the stations along the leg."""

    leg: Leg
    intrinsics: Intrinsics
    camera_from_object: Array
    world_from_object: Array
    stations: tuple[float, ...]

    @property
    def world_from_camera(self) -> Array:
        """Where the camera stands in the robot base frame."""
        return self.world_from_object @ invert(self.camera_from_object)

    def pixels(self, points: Array) -> Array:
        """Return pixels (N, 2) of object points (N, 3); NaN behind the camera."""
        return project(self.intrinsics, self.camera_from_object, points)

    def pixels_of_world(self, points: Array) -> Array:
        """Return pixels (N, 2) of points (N, 3) in the robot base frame."""
        return self.pixels(apply(invert(self.world_from_object), points))

    def visible(self, x: float, angle: Array) -> Array:
        """Say (N,) where the camera sees the ring at place `x`, by angle (N,) about the axis.

        The leg is convex: a point is seen where the side, or the face that it bounds, faces the
        camera.
        """
        to_eye = invert(self.camera_from_object)[:3, 3] - self.leg.surface_point(x, angle)
        side = np.sum(to_eye * self.leg.surface_normal(angle), axis=-1) > 0.0
        if x <= 0.0:
            return np.asarray(side | (to_eye[:, 0] < 0.0))
        return np.asarray(side | ((to_eye[:, 0] > 0.0) & (x >= self.leg.length)))


def leg_of(record: SessionRecord) -> Leg:
    """Return the leg of a record: its calibration's, its configuration's, or the paper's."""
    table = (record.calibration or {}).get("leg") or _table(record, "leg")
    paper = Leg()
    return Leg(
        big_radius=float(table.get("big_radius_mm", paper.big_radius)),
        small_radius=float(table.get("small_radius_mm", paper.small_radius)),
        length=float(table.get("length_mm", paper.length)),
        marks={n: tuple(p) for n, p in (table.get("marks") or paper.marks).items()},
    )


def stations_of(record: SessionRecord) -> tuple[float, ...]:
    """Return the stations in mm: the configuration's, the calibration's, or those touched."""
    configured = _table(record, "leg").get("stations_mm")
    if configured:
        return tuple(float(s) for s in configured)
    solved = (record.calibration or {}).get("stations") or []
    touched = [e["data"] for e in record.of_kind("contact")]
    return tuple(dict.fromkeys(float(s["station_mm"]) for s in solved or touched))


def scene_of(record: SessionRecord) -> Scene | None:
    """Return the scene of a record, None where no calibration was come to."""
    solved = record.calibration
    if solved is None or not NEEDED.issubset(solved):
        return None
    usual = Intrinsics(1.0, 1.0, 0.0, 0.0)
    camera = Intrinsics(
        alpha_u=float(solved["alpha_u"]),
        alpha_v=float(solved["alpha_v"]),
        u0=float(solved["u0"]),
        v0=float(solved["v0"]),
        k1=float(solved.get("k1") or 0.0),
        k2=float(solved.get("k2") or 0.0),
        width=int(solved.get("width") or usual.width),
        height=int(solved.get("height") or usual.height),
    )
    return Scene(
        leg=leg_of(record),
        intrinsics=camera,
        camera_from_object=np.asarray(solved["camera_from_object"], dtype=float),
        world_from_object=np.asarray(solved["world_from_object"], dtype=float),
        stations=stations_of(record),
    )


def silhouette(points: Array) -> Array:
    """Return the closed outline (K, 2) of a convex body from samples (N, 2) of its surface.

    In each direction the farthest sample is a corner.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    directions = np.stack([np.cos(angle), np.sin(angle)])
    return np.asarray(points[np.argmax(points @ directions, axis=0)])


def surface_samples(leg: Leg, along: int = 25, around: int = 96) -> Array:
    """Return points (N, 3) all over the leg's side, both rims included."""
    x = np.linspace(0.0, leg.length, along)[:, None]
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[None, :]
    return leg.surface_point(x, angle).reshape(-1, 3)


def _table(record: SessionRecord, name: str) -> Mapping[str, Any]:
    """Return one table of the configuration in the record, empty where there is none."""
    table = (record.meta.get("config") or {}).get(name)
    return table if isinstance(table, dict) else {}
