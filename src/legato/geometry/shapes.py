"""The arm's solid parts, and how far each is from the leg, the table and the arm's own base.

Forearm, hand and finger are capsules, sampled along their axes. The finger ends short of its
point by its radius and by a pad that may sink into tissue: the fingertip's touch is no breach.
"""

import numpy as np

from legato.geometry.arm import ArmModel
from legato.geometry.leg import Leg
from legato.geometry.transforms import Array, apply

PAD = 8.0  # mm of the fingertip that may sink in
SPACING = 4.0  # mm between samples along an axis; between two the distance errs by < 0.25 mm
PARTS = ("forearm", "hand", "finger")
OBSTACLES = ("leg", "table", "base")


class Shapes:
    """The solid parts of an arm among a leg, a table at `table_z` and the arm's own base."""

    def __init__(self, model: ArmModel, leg: Leg, table_z: float) -> None:
        knuckle = model.hand - model.finger_length
        tip = max(model.hand - model.finger_radius - PAD, knuckle)
        ends = (
            (model.forearm, (1, 2), 0.0, 1.0, model.forearm_radius),
            (model.hand, (2, 3), 0.0, knuckle / model.hand, model.hand_radius),
            (model.hand, (2, 3), knuckle / model.hand, tip / model.hand, model.finger_radius),
        )
        weights, radii, part = [], [], []
        for index, (length, (a, b), low, high, radius) in enumerate(ends):
            count = 2 + int(np.ceil((high - low) * length / SPACING))
            along = np.linspace(low, high, count)
            rows = np.zeros((count, 4))
            rows[:, a], rows[:, b] = 1.0 - along, along
            weights.append(rows)
            radii += [radius] * count
            part += [index] * count
        self._weights = np.concatenate(weights)
        self._radii = np.array(radii)
        self._starts = np.searchsorted(np.array(part), np.arange(len(PARTS)))
        self._leg = leg
        self._table_z = table_z
        self._base = (model.base_radius, model.shoulder_height)

    def clearance(self, skeletons: Array, object_from_world: Array) -> Array:
        """Return the clearance (N, parts, obstacles) of skeletons (N, 4, 3), negative in touch."""
        points = self._weights @ skeletons
        height = points[..., 2] - self._table_z
        radius, top = self._base
        out = np.hypot(points[..., 0], points[..., 1]) - radius
        up = points[..., 2] - top
        base = np.hypot(np.maximum(out, 0.0), np.maximum(up, 0.0))
        base += np.minimum(np.maximum(out, up), 0.0)
        leg = self._leg.clearance(apply(object_from_world, points))
        gaps = np.stack([leg, height, base], axis=-1) - self._radii[:, None]
        return np.minimum.reduceat(gaps, self._starts, axis=1)

    def deepest(self, skeleton: Array, part: int, obstacle: int, object_from_world: Array) -> Array:
        """Return the place (3,) on one part's axis of a skeleton (4, 3) nearest an obstacle."""
        points = self._weights @ skeleton
        own = slice(self._starts[part], [*self._starts, len(points)][part + 1])
        points = points[own]
        if OBSTACLES[obstacle] == "leg":
            gap = self._leg.clearance(apply(object_from_world, points))
        elif OBSTACLES[obstacle] == "table":
            gap = points[:, 2]
        else:
            gap = np.hypot(points[:, 0], points[:, 1])
        return np.asarray(points[int(np.argmin(gap))])
