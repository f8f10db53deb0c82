"""Leg models that are not the configured one."""

from collections.abc import Mapping

import numpy as np

from bench.vision.scenes import LEG
from legato.geometry.leg import Leg


def moved_marks(moves: Mapping[str, tuple[float, ...]]) -> Leg:
    """Return the leg with marks moved by developed coordinates, face marks kept on the face."""
    marks = dict(LEG.marks)
    for name, move in moves.items():
        x, y, z = LEG.mark_surface(name, np.asarray(move, dtype=float))
        if LEG.on_face(name):
            rho = max(1.0, float(np.hypot(y, z)) / 26.0)
            x, y, z = 0.0, y / rho, z / rho
        elif x < 5.0:
            x, y, z = LEG.surface_point(5.0, np.arctan2(-y, z))
        marks[name] = (float(x), float(y), float(z))
    return Leg(marks=marks)


def on_cone(big: float, small: float, length: float) -> Leg:
    """Return a leg of other measures, marked at the same places along and around."""
    shape = Leg(big, small, length)
    marks = {}
    for name, (x, y, z) in LEG.marks.items():
        if LEG.on_face(name):
            marks[name] = (x, y, z)
        else:
            at = shape.surface_point(x, LEG.mark_angle(name))
            marks[name] = (float(at[0]), float(at[1]), float(at[2]))
    return Leg(big, small, length, marks)


def scaled(by: float, mark_size: float) -> Leg:
    """Return the leg so many times as large, with marks of a given size (mm)."""
    marks = {n: (x * by, y * by, z * by) for n, (x, y, z) in LEG.marks.items()}
    return Leg(30.5 * by, 9.75 * by, 194.0 * by, marks, mark_size)
