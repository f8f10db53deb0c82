"""The leg model: a frustum with ten marks, in its own frame O.

Origin at the centre of the big face, x along the axis toward the ankle, z up, -y facing the
camera. Angles about the axis run from +z toward -y. Units mm and rad (paper sections 4.1, 4.2).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from legato.geometry.transforms import Array

Point = tuple[float, float, float]

# Paper section 4.2; P10's y is corrected (the paper repeats P7's).
PAPER_MARKS: Mapping[str, Point] = MappingProxyType(
    {
        "P1": (0.0, 0.0, 25.0),
        "P2": (12.9262, -20.5891, 20.5891),
        "P3": (42.7561, -18.333, 18.333),
        "P4": (82.5292, -15.3249, 15.3249),
        "P5": (12.9262, -29.1174, 0.0),
        "P6": (42.7561, -25.9268, 0.0),
        "P7": (82.5292, -21.6727, 0.0),
        "P8": (0.0, -17.6776, -17.6776),
        "P9": (157.1039, -9.6847, 9.6847),
        "P10": (157.1039, -13.6962, 0.0),
    }
)


@dataclass(frozen=True)
class Leg:
    """The frustum, its marks by name, and the size of a mark's side."""

    big_radius: float = 30.5
    small_radius: float = 9.75
    length: float = 194.0
    marks: Mapping[str, Point] = field(default_factory=lambda: PAPER_MARKS)
    mark_size: float = 8.0

    @property
    def slope(self) -> float:
        """Loss of radius per mm along the axis."""
        return (self.big_radius - self.small_radius) / self.length

    @property
    def half_angle(self) -> float:
        """Angle between axis and side."""
        return float(np.arctan(self.slope))

    def names(self) -> tuple[str, ...]:
        """Return the marks' names in their fixed order."""
        return tuple(self.marks)

    def points(self, names: tuple[str, ...] | None = None) -> Array:
        """Return mark centres (N, 3) in the order of `names` (all by default)."""
        return np.array([self.marks[n] for n in (names if names is not None else self.names())])

    def radius(self, x: ArrayLike) -> Array:
        """Return the side's radius (...) at places `x` along the axis."""
        return np.asarray(self.big_radius - self.slope * np.asarray(x, dtype=float))

    def surface_point(self, x: ArrayLike, angle: ArrayLike = 0.0) -> Array:
        """Return points (..., 3) on the side at place `x` and `angle` about the axis."""
        x, angle = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(angle, dtype=float))
        rho = self.radius(x)
        return np.stack([x, -rho * np.sin(angle), rho * np.cos(angle)], axis=-1)

    def surface_normal(self, angle: ArrayLike = 0.0) -> Array:
        """Return outward unit normals (..., 3) of the side; they do not depend on x."""
        angle = np.asarray(angle, dtype=float)
        h = self.half_angle
        return np.stack(
            [
                np.full_like(angle, np.sin(h)),
                -np.cos(h) * np.sin(angle),
                np.cos(h) * np.cos(angle),
            ],
            axis=-1,
        )

    def clearance(self, points: ArrayLike) -> Array:
        """Return the signed distance (...) of points (..., 3) from the frustum, negative inside."""
        p = np.asarray(points, dtype=float)
        x, rho = p[..., 0], np.hypot(p[..., 1], p[..., 2])
        h = self.half_angle
        # Signed distances from the three bounding planes of the half-section.
        side = (rho - self.big_radius) * np.cos(h) + x * np.sin(h)
        inside: Array = np.maximum.reduce([side, -x, x - self.length])
        outside: Array = np.minimum.reduce(
            [
                _segment_distance(x, rho, (0.0, 0.0), (0.0, self.big_radius)),
                _segment_distance(x, rho, (0.0, self.big_radius), (self.length, self.small_radius)),
                _segment_distance(x, rho, (self.length, self.small_radius), (self.length, 0.0)),
            ]
        )
        return np.where(inside <= 0.0, inside, outside)

    def on_face(self, name: str) -> bool:
        """Say whether a mark lies on the big face rather than on the side."""
        x, y, z = self.marks[name]
        return abs(x) < 1e-6 and float(np.hypot(y, z)) < self.big_radius - 1e-6

    def mark_angle(self, name: str) -> float:
        """Return a mark's angle about the axis."""
        _, y, z = self.marks[name]
        return float(np.arctan2(-y, z))

    def mark_coordinates(self, name: str, points: ArrayLike) -> Array:
        """Return the developed coordinates (..., 2) of surface points (..., 3) about a mark.

        The first runs along the generator toward the ankle (on the face: away from the axis), the
        second around the leg by growing angle. They are lengths on the paper of the pasted mark.
        """
        p = np.asarray(points, dtype=float)
        rho = np.hypot(p[..., 1], p[..., 2])
        turn = _wrapped(np.arctan2(-p[..., 1], p[..., 2]) - self.mark_angle(name))
        _, y0, z0 = self.marks[name]
        rho0 = float(np.hypot(y0, z0))
        if self.on_face(name):
            return np.stack([rho * np.cos(turn) - rho0, rho * np.sin(turn)], axis=-1)
        sine = np.sin(self.half_angle)
        slant, slant0, developed = rho / sine, rho0 / sine, turn * sine
        return np.stack([slant0 - slant * np.cos(developed), slant * np.sin(developed)], axis=-1)

    def mark_surface(self, name: str, coordinates: ArrayLike) -> Array:
        """Return surface points (..., 3) at developed coordinates (..., 2) about a mark."""
        c = np.asarray(coordinates, dtype=float)
        along, around = c[..., 0], c[..., 1]
        _, y0, z0 = self.marks[name]
        rho0 = float(np.hypot(y0, z0))
        if self.on_face(name):
            rho = np.hypot(rho0 + along, around)
            angle = self.mark_angle(name) + np.arctan2(around, rho0 + along)
            return np.stack(
                [np.zeros_like(rho), -rho * np.sin(angle), rho * np.cos(angle)], axis=-1
            )
        sine = np.sin(self.half_angle)
        slant0 = rho0 / sine
        slant = np.hypot(slant0 - along, around)
        angle = self.mark_angle(name) + np.arctan2(around, slant0 - along) / sine
        rho = slant * sine
        x = (self.big_radius - rho) / self.slope
        return np.stack([x, -rho * np.sin(angle), rho * np.cos(angle)], axis=-1)


def _segment_distance(x: Array, y: Array, a: tuple[float, float], b: tuple[float, float]) -> Array:
    """Return the distance of points (x, y) from the segment a b."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    along = ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy)
    along = np.clip(along, 0.0, 1.0)
    return np.hypot(x - a[0] - along * dx, y - a[1] - along * dy)


def _wrapped(angle: Array) -> Array:
    """Return angles brought into [-pi, pi)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi
