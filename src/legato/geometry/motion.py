"""Straight paths of the fingertip cut into short joint moves, in whole half-steps.

A `StepMove` is one motion command: relative half-steps of all six motors that start and end
together. The rate of the longest-moving motor is 10152 / (255 - speed) half-steps/s (manual;
inferred from one calibration point), the others scale with it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from legato.geometry.arm import (
    ArmModel,
    Unreachable,
    backward,
    broken_limits,
    forward,
    joints_from_steps,
    steps_from_joints,
)
from legato.geometry.transforms import Array

RATE_CONSTANT = 10152.0
SPEED_ZERO = 255
SPEEDS = (0, 245)
SAMPLES = 64  # of a line that is cut where equal times end

Steps = tuple[int, int, int, int, int, int]


@dataclass(frozen=True)
class ToolPose:
    """The fingertip's place in the robot base frame (mm), pitch and roll (rad), opening (mm)."""

    x: float
    y: float
    z: float
    pitch: float = -np.pi / 2
    roll: float = 0.0
    grip: float = 0.0

    @property
    def xyz(self) -> Array:
        """The place as an array (3,)."""
        return np.array([self.x, self.y, self.z])

    def vector(self) -> Array:
        """Return x, y, z, pitch, roll, grip as an array (6,)."""
        return np.array([self.x, self.y, self.z, self.pitch, self.roll, self.grip])


@dataclass(frozen=True)
class StepMove:
    """One motion command: relative half-steps and the robot's speed number."""

    steps: Steps
    speed: int

    @property
    def duration(self) -> float:
        """Seconds that the motion takes."""
        return max(abs(s) for s in self.steps) / rate_of(self.speed)

    def rates(self) -> Array:
        """Return each motor's rate (6,) in half-steps/s."""
        longest = max(max(abs(s) for s in self.steps), 1)
        return np.asarray(np.abs(self.steps) * (rate_of(self.speed) / longest))


def rate_of(speed: int) -> float:
    """Return half-steps/s of the longest-moving motor at a speed number."""
    return RATE_CONSTANT / (SPEED_ZERO - speed)


def speed_for(steps: ArrayLike, rates: ArrayLike) -> int:
    """Return the highest speed number at which no motor exceeds its rate (6,)."""
    s = np.abs(np.asarray(steps, dtype=float))
    longest = s.max()
    if longest == 0:
        return SPEEDS[0]
    allowed = float(np.min(np.asarray(rates)[s > 0] * longest / s[s > 0]))
    return int(np.clip(np.floor(SPEED_ZERO - RATE_CONSTANT / allowed), *SPEEDS))


def move_between(
    model: ArmModel, start: ArrayLike, end: ArrayLike, scale: float = 1.0, least: float = 0.0
) -> StepMove:
    """Return the motion command from whole steps `start` (6,) to `end` (6,).

    It is as fast as `scale` of the motors' rates allows, but lasts at least `least` s where the
    robot can go so slowly.
    """
    steps = np.asarray(end, dtype=int) - np.asarray(start, dtype=int)
    one, two, three, four, five, six = (int(s) for s in steps)
    rates = np.asarray(model.rates) * scale
    if least > 0.0:
        rates = np.minimum(rates, max(int(np.abs(steps).max()), 1) / least)
    return StepMove((one, two, three, four, five, six), speed_for(steps, rates))


def pose_steps(model: ArmModel, poses: ArrayLike) -> Array:
    """Return steps (..., 6), not rounded, of pose vectors (..., 6); NaN where out of reach."""
    p = np.asarray(poses, dtype=float)
    joints = backward(model, p[..., :3], p[..., 3], p[..., 4])
    return steps_from_joints(model, joints, p[..., 5])


def straight_path(
    model: ArmModel,
    start: ToolPose,
    end: ToolPose,
    *,
    chord: float = 0.24,
    longest: float = 0.19,
    scale: float = 1.0,
    pieces: int = 1,
    tolerance: float = 1e-9,
) -> Array:
    """Return waypoints (N, 6) in steps, not rounded, after `start` up to and with `end`.

    There are at least `pieces` of them, then of equal length. The fingertip keeps to the straight
    line within `chord` mm (0.01 under what is promised: rounding to half-steps takes some), and
    each piece lasts at most `longest` s at `scale` of the motors' rates; the robot's whole speed
    numbers make that up to 5 % more. Raises Unreachable, naming the place, where a waypoint is out
    of reach or breaks a joint's limit by more than `tolerance` rad.
    """
    a, b = start.vector(), end.vector()
    if np.array_equal(a, b):
        return np.empty((0, 6))
    rates, count = np.asarray(model.rates) * scale, pieces
    paces: list[Callable[[int], Array]] = [_even]
    while True:
        excess = np.inf
        for pace in paces:
            poses = a + pace(count)[:, None] * (b - a)
            steps = pose_steps(model, poses)
            _refuse_unreachable(model, poses, tolerance)
            time = float(((np.abs(np.diff(steps, axis=0)) + 1.0) / rates).max())
            over = max(time / longest, np.sqrt(_chord_error(model, poses, steps) / chord))
            if over <= 1.0:
                return steps[1:]
            excess = min(excess, over)
        if pieces == 1 and len(paces) == 1:  # one piece does for most moves; they need no more
            paces.append(_equal_times(model, a, b, rates))
        count = max(count + 1, int(count * excess))


def _even(count: int) -> Array:
    """Return the fractions (count + 1,) of a line at which equal lengths begin and end."""
    return np.linspace(0.0, 1.0, count + 1)


def _equal_times(model: ArmModel, a: Array, b: Array, rates: Array) -> Callable[[int], Array]:
    """Return what cuts the line from `a` to `b` where equal times at the motors' rates end.

    Where time decides, fewer commands do than in equal lengths: none is short because another,
    where the joints turn faster, is as long as it may be. Where the chord decides, more may.
    """
    fine = _even(SAMPLES)
    steps = pose_steps(model, a + fine[:, None] * (b - a))
    spent = np.cumsum((np.abs(np.diff(steps, axis=0)) / rates).max(axis=1))
    if not np.isfinite(spent).all() or spent[-1] <= 0.0:
        return _even
    return lambda count: np.interp(_even(count) * spent[-1], np.append(0.0, spent), fine)


def _refuse_unreachable(model: ArmModel, poses: Array, tolerance: float) -> None:
    """Raise Unreachable for the first pose (N, 6) that the arm cannot take."""
    joints = backward(model, poses[:, :3], poses[:, 3], poses[:, 4])
    for pose, joint in zip(poses, joints, strict=True):
        broken = broken_limits(model, joint, tolerance)
        if broken:
            place = ", ".join(f"{v:.1f}" for v in pose[:3])
            raise Unreachable(f"({place}) mm: {broken[0]}")


def _chord_error(model: ArmModel, poses: Array, steps: Array) -> float:
    """Return the largest distance of joint-space midpoints from the straight line's midpoints."""
    middle, _ = joints_from_steps(model, (steps[1:] + steps[:-1]) / 2.0)
    place, _, _ = forward(model, middle)
    return float(np.linalg.norm(place - (poses[1:, :3] + poses[:-1, :3]) / 2.0, axis=-1).max())


def rounded(waypoints: Array, grip_per_elbow: float = 1.0) -> Iterator[Steps]:
    """Yield each waypoint (6,) in whole steps, the gripper's motor rounded with the elbow's.

    `grip_per_elbow` is the arm model's: how far motor 6 has to follow motor 3. Rounding absolute
    targets carries the remainder: it never adds up along a path.
    """
    for w in waypoints:
        one, two, three, four, five = (round(float(v)) for v in w[:5])
        follows = grip_per_elbow * (three - float(w[2]))
        yield one, two, three, four, five, round(float(w[5]) + follows)
