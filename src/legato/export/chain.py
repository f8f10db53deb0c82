"""The arm as a chain of links and joints, the way URDF and transform trees see it.

House joints are absolute elevations; a chain's are turns against the link before, rad.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from legato.geometry.arm import ArmModel
from legato.geometry.transforms import Array, rotation_from_vector, transform

UP = (0.0, -1.0, 0.0)  # turns x toward z


@dataclass(frozen=True)
class Joint:
    """One joint: its links, where it sits in the parent (mm), its axis there, limits in rad."""

    name: str
    parent: str
    child: str
    origin: tuple[float, float, float]
    axis: tuple[float, float, float]
    limits: tuple[float, float]
    speed: float

    def parent_from_child(self, angle: float) -> Array:
        """Return the child's frame in the parent's, 4x4, at an angle."""
        turn = rotation_from_vector(np.asarray(self.axis) * angle)
        return transform(turn, np.asarray(self.origin))


ROOT, TIP = "base", "fingertip"


def chain(model: ArmModel) -> tuple[Joint, ...]:
    """Return the five joints from the base to the hand; the fingertip is fixed to the hand."""
    lim = model.limits
    rates = np.asarray(model.rates[:5]) / model.steps_per_rad
    base, shoulder, elbow, wrist, roll = (float(r) for r in rates)
    rows = (
        ("base_yaw", ROOT, "turret", (0.0, 0.0, model.shoulder_height), (0.0, 0.0, 1.0), lim.base,
         base),
        ("shoulder", "turret", "upper_arm", (0.0, 0.0, 0.0), UP, lim.shoulder, shoulder),
        ("elbow", "upper_arm", "forearm", (model.upper_arm, 0.0, 0.0), UP, lim.elbow,
         shoulder + elbow),
        ("wrist_pitch", "forearm", "wrist", (model.forearm, 0.0, 0.0), UP, lim.wrist,
         elbow + wrist),
        ("wrist_roll", "wrist", "hand", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), lim.roll, roll),
    )  # fmt: skip
    return tuple(Joint(*row) for row in rows)


def chain_angles(joints: ArrayLike) -> Array:
    """Return the chain's angles (..., 5) of house joints (..., 5): elevations become turns."""
    t1, t2, t3, pitch, roll = np.moveaxis(np.asarray(joints, dtype=float), -1, 0)
    return np.stack([t1, t2, t3 - t2, pitch - t3, roll], axis=-1)
