"""Where the fingertip has to be: each station's line of descent, its lead-in, and the transit.

The descent runs along the surface normal, turned into the vertical plane through the base axis so
that the base motor stands still, and ends on the station whatever the height of the surface. The
lead-in brings base and both wrist motors to the approach point by a forward move, so that their
backlash is taken up on the same side every time (shoulder and elbow go forward in the descent).
"""

from dataclasses import dataclass, replace

import numpy as np

from legato.control.perceive import Calibration
from legato.control.settings import CellSettings
from legato.geometry.arm import forward, joints_from_steps
from legato.geometry.motion import Steps, ToolPose
from legato.geometry.transforms import Array

LEAD_IN_PITCH = np.radians(4.0)
MOST_LEAN = np.radians(20.0)


@dataclass(frozen=True)
class StationPlan:
    """One station in the robot base frame: predicted surface, way up, and poses on the way."""

    station: float
    surface: Array
    up: Array
    approach: ToolPose
    lead_in: ToolPose

    def height(self, xyz: Array) -> float:
        """Return how far a place lies above the predicted surface along the line of descent."""
        return float((np.asarray(xyz) - self.surface) @ self.up)

    def at(self, height: float) -> ToolPose:
        """Return the pose on the line of descent at a height over the predicted surface."""
        x, y, z = self.surface + height * self.up
        return replace(self.approach, x=float(x), y=float(y), z=float(z))


def plan_stations(settings: CellSettings, calibration: Calibration) -> list[StationPlan]:
    """Return each station's plan in the configured order."""
    heading = calibration.world_from_object[:2, 0]
    yaw = float(np.arctan2(heading[1], heading[0]))
    places = zip(settings.stations, calibration.stations, calibration.normals, strict=True)
    plans: list[StationPlan] = []
    for station, place, normal in places:
        before = plans[-1].approach.roll if plans else None
        plans.append(_plan(settings, station, place, normal, yaw, before))
    return plans


def _plan(
    settings: CellSettings,
    station: float,
    surface: Array,
    normal: Array,
    yaw: float,
    before: float | None,
) -> StationPlan:
    base = float(np.arctan2(surface[1], surface[0]))
    sideways = np.array([-np.sin(base), np.cos(base), 0.0])
    up = normal - (normal @ sideways) * sideways
    up = up / np.linalg.norm(up)
    x, y, z = surface + settings.approach * up
    roll = finger_roll(base, yaw)
    if before is not None:  # the hand never turns the long way round from station to station
        roll += 2.0 * np.pi * round((before - roll) / (2.0 * np.pi))
    pitch = -np.pi / 2
    if settings.massage.follow_normal:
        pitch = _leaning(up, base)
    approach = ToolPose(float(x), float(y), float(z), pitch, roll, settings.home.grip)
    back = settings.lead_in / float(np.hypot(x, y))
    radius, turned = float(np.hypot(x, y)), base - back
    lead_in = replace(
        approach,
        x=radius * float(np.cos(turned)),
        y=radius * float(np.sin(turned)),
        pitch=approach.pitch + (LEAD_IN_PITCH if settings.lead_in else 0.0),
    )
    return StationPlan(station, surface, up, approach, lead_in)


def _leaning(up: Array, base: float) -> float:
    """Return the pitch that brings the hand along `up`, as far from -90 deg as it may lean."""
    radial = float(up[:2] @ [np.cos(base), np.sin(base)])
    lean = float(np.arctan2(-up[2], -radial)) + np.pi / 2
    return float(np.clip(lean, -MOST_LEAN, MOST_LEAN)) - np.pi / 2


def finger_roll(base: float, yaw: float) -> float:
    """Return the roll R' that brings T's y along the leg's axis (paper section 4.4).

    `base` is T1 and `yaw` the axis' heading; at pitch -90 the tool's y heads to T1 + 90 deg - R'.
    The result lies in (-pi, pi].
    """
    roll = base + np.pi / 2 - yaw
    return float(-((-roll + np.pi) % (2 * np.pi) - np.pi))


def transit(settings: CellSettings, here: ToolPose, goal: ToolPose) -> list[ToolPose]:
    """Return the way to `goal`: straight up to the height of home, across, straight down."""
    height = max(settings.home.z, here.z, goal.z)
    way = [replace(here, z=height), replace(goal, z=height), goal]
    poses = [here]
    for pose in way:
        if not np.allclose(pose.vector(), poses[-1].vector(), atol=1e-6):
            poses.append(pose)
    return poses[1:]


def pose_at(settings: CellSettings, steps: Steps) -> ToolPose:
    """Return the fingertip's pose at absolute steps."""
    joints, grip = joints_from_steps(settings.arm, steps)
    xyz, pitch, roll = forward(settings.arm, joints)
    x, y, z = (float(v) for v in xyz)
    return ToolPose(x, y, z, float(pitch), float(roll), float(grip))
