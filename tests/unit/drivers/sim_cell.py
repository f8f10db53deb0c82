"""A simulated cell without a daemon: its world, and an arm in it."""

from typing import Any

import numpy as np

from legato.drivers.sim.clock import ManualClock
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import World
from legato.geometry.arm import ArmModel
from legato.geometry.leg import Leg
from legato.geometry.motion import (
    Steps,
    ToolPose,
    move_between,
    pose_steps,
    rounded,
    straight_path,
)
from legato.geometry.transforms import Array, transform

MODEL, LEG = ArmModel(), Leg()
HOME = ToolPose(127.0, 0.0, 150.0)
FAR = transform(np.eye(3), [0.0, 2000.0, 31.0])
SLOW = 100


class Cell:
    """A world and the means to move its fingertip; registers are counted as a host would."""

    def __init__(self, **true: Any) -> None:
        still: dict[str, Any] = {"scatter_mm": 0.0, "scatter_deg": 0.0, "backlash_steps": 0.0}
        self.clock = ManualClock()
        self.world = World(SimSettings(**{**still, **true}), LEG, MODEL, self.clock)
        self.at = whole(HOME)
        self.pose = HOME

    def go(self, x: float, y: float, z: float, pitch: float = -np.pi / 2) -> None:
        """Move the fingertip along a straight line."""
        end = ToolPose(x, y, z, pitch)
        for target in rounded(straight_path(MODEL, self.pose, end)):
            self.world.step(move_between(MODEL, self.at, target))
            self.at = target
        self.pose = end

    @property
    def breaches(self) -> list[dict[str, Any]]:
        """The world's breaches."""
        found = self.world.testimony()["breaches"]
        assert isinstance(found, list)
        return found

    @property
    def touches(self) -> list[dict[str, Any]]:
        """The world's touches."""
        found = self.world.testimony()["touches"]
        assert isinstance(found, list)
        return found

    @property
    def tip(self) -> Array:
        """Where the fingertip truly is."""
        tip: Any = self.world.testimony()["tip"]
        return np.array(tip["xyz_mm"])


def whole(pose: ToolPose) -> Steps:
    """Return a pose's rounded half-steps."""
    return next(iter(rounded(pose_steps(MODEL, pose.vector())[None])))


def only(**steps: int) -> Steps:
    """Return steps of the named motors (m1 to m6), zero elsewhere."""
    a, b, c, d, e, f = (steps.get(f"m{i}", 0) for i in range(1, 7))
    return a, b, c, d, e, f
