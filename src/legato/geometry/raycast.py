"""Rays against the leg: the point of the frustum that each meets first.

Rays are origins and directions in the object frame; the side gives a quadratic in the ray
parameter, each face a linear equation. Everything is vectorised over leading axes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from legato.geometry.leg import Leg
from legato.geometry.transforms import Array, invert

MISS, SIDE, BIG_FACE, SMALL_FACE = 0, 1, 2, 3


@dataclass(frozen=True)
class Hits:
    """Where rays meet the leg first; rows of rays that miss hold NaN.

    `part` (...) is MISS, SIDE, BIG_FACE or SMALL_FACE, `distance` (...) counts lengths of the
    direction given, `points` and `normals` (..., 3) are in the object frame, normals outward.
    """

    part: NDArray[np.int8]
    distance: Array
    points: Array
    normals: Array

    @property
    def hit(self) -> NDArray[np.bool_]:
        """Which rays meet the leg."""
        return np.asarray(self.part != MISS)


def cast(leg: Leg, origins: ArrayLike, directions: ArrayLike) -> Hits:
    """Return the first meeting of rays from `origins` along `directions` (..., 3) with the leg."""
    o, d = np.broadcast_arrays(
        np.asarray(origins, dtype=float), np.asarray(directions, dtype=float)
    )
    candidates = [
        *((SIDE, t) for t in _side_distances(leg, o, d)),
        (BIG_FACE, _face_distance(o, d, 0.0, leg.big_radius)),
        (SMALL_FACE, _face_distance(o, d, leg.length, leg.small_radius)),
    ]
    distance = np.full(o.shape[:-1], np.inf)
    part = np.zeros(o.shape[:-1], dtype=np.int8)
    for which, t in candidates:
        nearer = t < distance
        distance = np.where(nearer, t, distance)
        part[nearer] = which
    distance = np.where(part == MISS, np.nan, distance)
    points = o + distance[..., None] * d
    return Hits(part, distance, points, normals_of(leg, part, points))


def points_on(leg: Leg, part: int, origins: ArrayLike, directions: ArrayLike) -> Array:
    """Return where rays first meet the named part (..., 3), NaN where they miss it.

    What else lies before it is not asked: a part that faces the origin hides nothing of itself.
    """
    o, d = np.broadcast_arrays(
        np.asarray(origins, dtype=float), np.asarray(directions, dtype=float)
    )
    if part == SIDE:
        t = np.minimum(*_side_distances(leg, o, d))
    else:
        x, radius = (0.0, leg.big_radius) if part == BIG_FACE else (leg.length, leg.small_radius)
        t = _face_distance(o, d, x, radius)
    t[np.isinf(t)] = np.nan
    return np.asarray(o + t[..., None] * d)


def normals_of(leg: Leg, part: NDArray[np.int8], points: Array) -> Array:
    """Return outward unit normals (..., 3) of surface points (..., 3) on the named parts."""
    h = leg.half_angle
    y, z = points[..., 1], points[..., 2]
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = np.cos(h) / np.hypot(y, z)
        side = np.stack([np.full_like(y, np.sin(h)), y * scale, z * scale], axis=-1)
    faces = np.array([[np.nan] * 3, [np.nan] * 3, [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    return np.where((part == SIDE)[..., None], side, faces[part])


def object_rays(camera_from_object: ArrayLike, normalised: ArrayLike) -> tuple[Array, Array]:
    """Return the origin (3,) and directions (..., 3) in the object frame of pixels' rays.

    `normalised` (..., 2) are undistorted image coordinates; a direction's length is such that the
    distance along it is the depth in mm.
    """
    object_from_camera = invert(camera_from_object)
    n = np.asarray(normalised, dtype=float)
    r = object_from_camera[:3, :3]
    directions = n[..., :1] * r[:, 0] + n[..., 1:] * r[:, 1] + r[:, 2]
    return object_from_camera[:3, 3], directions


def facing(leg: Leg, name: str, camera_from_object: ArrayLike) -> float:
    """Return the cosine between a mark's outward normal and the way to the camera.

    The leg is convex, so a mark is in sight of the camera exactly where this is positive.
    """
    centre = np.asarray(leg.marks[name])
    normal = (
        np.array([-1.0, 0.0, 0.0])
        if leg.on_face(name)
        else leg.surface_normal(leg.mark_angle(name))
    )
    away = invert(camera_from_object)[:3, 3] - centre
    return float(away @ normal / np.linalg.norm(away))


def _side_distances(leg: Leg, o: Array, d: Array) -> tuple[Array, Array]:
    """Return both distances at which rays cross the side, inf where they do not."""
    s, rho = leg.slope, leg.big_radius - leg.slope * o[..., 0]
    a = d[..., 1] ** 2 + d[..., 2] ** 2 - (s * d[..., 0]) ** 2
    b = o[..., 1] * d[..., 1] + o[..., 2] * d[..., 2] + s * d[..., 0] * rho
    c = o[..., 1] ** 2 + o[..., 2] ** 2 - rho**2
    with np.errstate(invalid="ignore", divide="ignore"):
        # The sum of like signs keeps both roots exact where one is nearly zero.
        q = -(b + np.copysign(np.sqrt(b * b - a * c), b))
        roots = (q / a, c / q)
        places = [o[..., 0] + t * d[..., 0] for t in roots]
    first, second = (
        np.where((t > 0.0) & (x >= 0.0) & (x <= leg.length), t, np.inf)
        for t, x in zip(roots, places, strict=True)
    )
    return first, second


def _face_distance(o: Array, d: Array, x: float, radius: float) -> Array:
    """Return the distance at which rays cross the disc at place `x`, inf where they do not."""
    with np.errstate(invalid="ignore", divide="ignore"):
        t = (x - o[..., 0]) / d[..., 0]
        rho2 = (o[..., 1] + t * d[..., 1]) ** 2 + (o[..., 2] + t * d[..., 2]) ** 2
    return np.where((t > 0.0) & (rho2 <= radius * radius), t, np.inf)
