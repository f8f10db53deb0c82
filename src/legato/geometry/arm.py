"""The TeachMover's kinematics: registers, joints, and the fingertip's pose.

Joints are arrays (..., 5) in rad: T1 base, T2 elevation of the upper arm, T3 ABSOLUTE elevation of
the forearm, P ABSOLUTE pitch of the hand, R' roll about the hand in the arm's frame. Steps are
arrays (..., 6) of half-steps counted from "stretched forward, pitch 0, roll 0, gripper closed".
Poses are the fingertip's: X, Y, Z in the robot base frame, pitch, roll. Source: the arm's manual.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from legato.geometry.transforms import Array

INCH = 25.4
MOTOR_NAMES = ("base", "shoulder", "elbow", "right wrist", "left wrist", "gripper")


class Unreachable(ValueError):
    """No joint angles bring the fingertip to a pose, or they break a limit."""


@dataclass(frozen=True)
class ArmLimits:
    """Joint ranges in rad; elbow is T3 - T2, wrist is P - T3, roll is R'."""

    base: tuple[float, float] = (-np.pi / 2, np.pi / 2)
    shoulder: tuple[float, float] = (np.radians(-35.0), np.radians(144.0))
    elbow: tuple[float, float] = (np.radians(-149.0), 0.0)
    wrist: tuple[float, float] = (-np.pi / 2, np.pi / 2)
    roll: tuple[float, float] = (-2 * np.pi, 2 * np.pi)


@dataclass(frozen=True)
class ArmModel:
    """Lengths in mm, counts in half-steps, rates in half-steps/s; defaults are the manual's."""

    shoulder_height: float = 193.675
    upper_arm: float = 177.8
    forearm: float = 177.8
    hand: float = 96.52
    steps_per_rev: tuple[float, float, float, float, float] = (7072, 7072, 4158, 1536, 1536)
    grip_steps_per_mm: float = 371 / INCH
    grip_per_elbow: float = 1.0  # half-steps of motor 6 for one of motor 3 that hold the gripper
    roll_sign: int = 1
    rates: tuple[float, ...] = (473.0, 405.0, 543.0, 494.0, 494.0, 292.0)
    limits: ArmLimits = field(default_factory=ArmLimits)
    # Shape for collision checks: the manual gives none, so these stay in configuration.
    hand_radius: float = 20.0
    finger_length: float = 45.0
    finger_radius: float = 8.0
    forearm_radius: float = 25.0
    base_radius: float = 45.0  # of the column that carries the shoulder

    @property
    def steps_per_rad(self) -> Array:
        """Half-steps per rad of motors 1 to 5."""
        return np.asarray(self.steps_per_rev) / (2.0 * np.pi)


def forward(model: ArmModel, joints: ArrayLike) -> tuple[Array, Array, Array]:
    """Return the fingertip's place (..., 3), pitch (...) and roll (...) of joints (..., 5)."""
    j = np.asarray(joints, dtype=float)
    return skeleton(model, j)[..., 3, :], j[..., 3], j[..., 4]


def skeleton(model: ArmModel, joints: ArrayLike) -> Array:
    """Return shoulder, elbow, wrist and fingertip (..., 4, 3) of joints (..., 5)."""
    j = np.asarray(joints, dtype=float)
    elevation = np.stack([j[..., 1], j[..., 2], j[..., 3]], axis=-1)
    lengths = np.array([model.upper_arm, model.forearm, model.hand])
    out = np.cumsum(lengths * np.cos(elevation), axis=-1)
    up = np.cumsum(lengths * np.sin(elevation), axis=-1) + model.shoulder_height
    zero = np.zeros_like(out[..., :1])
    out = np.concatenate([zero, out], axis=-1)
    up = np.concatenate([zero + model.shoulder_height, up], axis=-1)
    base = j[..., 0, None]
    return np.stack([out * np.cos(base), out * np.sin(base), up], axis=-1)


def backward(model: ArmModel, xyz: ArrayLike, pitch: ArrayLike, roll: ArrayLike) -> Array:
    """Return joints (..., 5) that bring the fingertip to places (..., 3), elbow up.

    NaN where the wrist is out of reach. Limits are not looked at: see `broken_limits`.
    """
    p = np.asarray(xyz, dtype=float)
    pitch, roll = np.asarray(pitch, dtype=float), np.asarray(roll, dtype=float)
    base = np.arctan2(p[..., 1], p[..., 0])
    out = np.hypot(p[..., 0], p[..., 1]) - model.hand * np.cos(pitch)
    up = p[..., 2] - model.hand * np.sin(pitch) - model.shoulder_height
    reach = np.hypot(out, up)
    a, b = model.upper_arm, model.forearm
    with np.errstate(invalid="ignore", divide="ignore"):
        first = np.arccos((a * a + reach**2 - b * b) / (2.0 * a * reach))
        second = np.arccos((b * b + reach**2 - a * a) / (2.0 * b * reach))
    beta = np.arctan2(up, out)
    columns = np.broadcast_arrays(base, beta + first, beta - second, pitch, roll)
    return np.stack(columns, axis=-1)


def broken_limits(model: ArmModel, joints: ArrayLike, tolerance: float = 1e-9) -> list[str]:
    """Return, for one joint vector (5,), a sentence for each range it breaks.

    It may pass each end by `tolerance` rad; below 0 it has to keep so far off.
    """
    t1, t2, t3, pitch, roll = (float(v) for v in np.asarray(joints, dtype=float))
    if not np.isfinite([t1, t2, t3, pitch, roll]).all():
        return ["out of reach"]
    lim = model.limits
    found = []
    off = max(-tolerance, 0.0)
    digits, ends = (2, 2) if off else (1, 0)
    spare = f" deg, {np.degrees(off):.1f} deg within its ends" if off else " deg"
    for name, value, (low, high) in (
        ("base", t1, lim.base),
        ("shoulder", t2, lim.shoulder),
        ("elbow", t3 - t2, lim.elbow),
        ("wrist", pitch - t3, lim.wrist),
        ("roll", roll, lim.roll),
    ):
        if not low - tolerance <= value <= high + tolerance:
            found.append(
                f"{name} {np.degrees(value):.{digits}f} deg is outside "
                f"{np.degrees(low + off):.{ends}f} to {np.degrees(high - off):.{ends}f}{spare}"
            )
    return found + _body_conflicts(model, t1, t2, t3, pitch)


def _body_conflicts(model: ArmModel, t1: float, t2: float, t3: float, pitch: float) -> list[str]:
    """Return where the hand would meet the arm's own body (manual, with its inch figures)."""
    shoulder, _, wrist, tip = skeleton(model, [t1, t2, t3, pitch, 0.0])
    out = float(np.hypot(tip[0], tip[1]))
    wrist_out = float(np.hypot(wrist[0], wrist[1]))
    found = []
    if np.linalg.norm(tip - shoulder) > 17.8 * INCH + 1e-6:
        found.append("fingertip is beyond 17.8 in from the shoulder")
    if out < 2.25 * INCH and tip[2] < 15.0 * INCH:
        found.append(f"hand is {out:.0f} mm from the base axis, closer than 57 mm")
    near = wrist_out < 3.5 * INCH and tip[0] < 2.25 * INCH and tip[2] < 1.25 * INCH
    if near and pitch < -np.pi / 2 - 1e-9:
        found.append("hand would meet the base")
    return found


def reach(model: ArmModel, xyz: ArrayLike, pitch: float, roll: float) -> Array:
    """Return joints (5,) for one pose inside every limit; raises Unreachable with the reasons."""
    joints = backward(model, xyz, pitch, roll)
    broken = broken_limits(model, joints)
    if broken:
        place = ", ".join(f"{v:.1f}" for v in np.asarray(xyz, dtype=float))
        raise Unreachable(f"({place}) mm at pitch {np.degrees(pitch):.0f} deg: {broken[0]}")
    return joints


def steps_from_joints(model: ArmModel, joints: ArrayLike, grip: ArrayLike = 0.0) -> Array:
    """Return steps (..., 6), not rounded, of joints (..., 5) and a gripper opening in mm.

    Motor 6 follows motor 3 (one to one in the manual), or its cable would open and close the
    gripper.
    """
    j = np.asarray(joints, dtype=float)
    k = model.steps_per_rad
    pitch, roll = j[..., 3], model.roll_sign * j[..., 4]
    s3 = -k[2] * j[..., 2]
    columns = [
        k[0] * j[..., 0],
        -k[1] * j[..., 1],
        s3,
        -k[3] * (pitch - roll),
        -k[4] * (pitch + roll),
        model.grip_per_elbow * s3 + model.grip_steps_per_mm * np.asarray(grip, dtype=float),
    ]
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


def joints_from_steps(model: ArmModel, steps: ArrayLike) -> tuple[Array, Array]:
    """Return joints (..., 5) and the gripper opening (...) in mm of steps (..., 6)."""
    s = np.asarray(steps, dtype=float)
    k = model.steps_per_rad
    right, left = -s[..., 3] / k[3], -s[..., 4] / k[4]
    joints = np.stack(
        [
            s[..., 0] / k[0],
            -s[..., 1] / k[1],
            -s[..., 2] / k[2],
            (right + left) / 2.0,
            model.roll_sign * (left - right) / 2.0,
        ],
        axis=-1,
    )
    return joints, (s[..., 5] - model.grip_per_elbow * s[..., 2]) / model.grip_steps_per_mm
