"""The arm's kinematics against the manual's published figures, and against itself."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.geometry.arm import (
    INCH,
    ArmLimits,
    ArmModel,
    Unreachable,
    backward,
    broken_limits,
    forward,
    joints_from_steps,
    reach,
    skeleton,
    steps_from_joints,
)
from legato.geometry.transforms import Array

MODEL = ArmModel()

# Place in inches, pitch and roll in deg; T1, T2, T3 in deg; motors 1 to 5 in half-steps.
PUBLISHED = [
    ((5, 0, 0, -90, 0), (0, 25.862, -100.694), (0, -508.0, 1163.0, 384.0, 384.0)),
    ((8, 0, 0, -90, 0), (0, 25.146, -76.253), (0, -494.0, 880.7, 384.0, 384.0)),
    ((8, 5, 1, -90, 0), (32.005, 28.628, -61.968), (628.7, -562.4, 715.7, 384.0, 384.0)),
    ((12, -3, 4, 0, 0), (-14.036, 25.418, -71.277), (-275.7, -499.3, 823.3, 0, 0)),
]

inside = st.tuples(
    st.floats(-1.5, 1.5), st.floats(-0.6, 2.4), st.floats(0.01, 2.59),
    st.floats(-1.5, 1.5), st.floats(-6.0, 6.0),
).map(lambda t: np.array([t[0], t[1], t[1] - t[2], t[1] - t[2] + t[3], t[4]]))  # fmt: skip


@pytest.mark.parametrize(("pose", "angles_deg", "steps"), PUBLISHED)
def test_published_poses_give_the_published_angles_and_counts(
    pose: tuple[float, ...], angles_deg: tuple[float, ...], steps: tuple[float, ...]
) -> None:
    """Backward solution and counts reproduce the manual's table to its printed digits."""
    joints = backward(MODEL, np.array(pose[:3]) * INCH, *np.radians(pose[3:]))
    assert np.degrees(joints[:3]) == pytest.approx(angles_deg, abs=6e-4)
    assert steps_from_joints(MODEL, joints)[:5] == pytest.approx(steps, abs=0.06)


def test_roll_in_the_base_frame_turns_with_the_base() -> None:
    """The table's R1 = 1 row: a roll that adds the base's angle moves the wrists apart."""
    joints = backward(MODEL, np.array([8, 5, 1]) * INCH, -np.pi / 2, np.arctan2(5, 8))
    steps = steps_from_joints(MODEL, joints)
    assert steps[:5] == pytest.approx((628.7, -562.4, 715.7, 520.6, 247.4), abs=0.06)


def test_roll_sign_is_the_configurations() -> None:
    """The other sign swaps the wrist motors' parts and reads back as the same roll."""
    other = ArmModel(roll_sign=-1)
    joints = np.array([0.1, 0.4, -1.0, -1.5, 0.3])
    ours, theirs = steps_from_joints(MODEL, joints), steps_from_joints(other, joints)
    assert ours[3:5] == pytest.approx(theirs[[4, 3]])
    assert joints_from_steps(other, theirs)[0] == pytest.approx(joints)


@settings(deadline=None)
@given(inside, st.floats(0.0, 76.0))
def test_steps_and_joints_are_inverse(joints: Array, grip: float) -> None:
    """Joints and opening survive the way to half-steps and back."""
    again, opening = joints_from_steps(MODEL, steps_from_joints(MODEL, joints, grip))
    assert again == pytest.approx(joints, abs=1e-9)
    assert float(opening) == pytest.approx(grip, abs=1e-9)


@settings(deadline=None)
@given(inside)
def test_backward_undoes_forward(joints: Array) -> None:
    """The elbow-up solution of a pose is the joints that made it, to 1e-6 rad."""
    place, pitch, roll = forward(MODEL, joints)
    wrist_out = np.cos(joints[1]) + np.cos(joints[2])
    tip_out = MODEL.upper_arm * wrist_out + MODEL.hand * np.cos(joints[3])
    if tip_out < 1.0 or joints[1] - joints[2] < 0.05:
        return  # behind the base axis, or stretched: there the base or the elbow is not unique
    assert backward(MODEL, place, pitch, roll) == pytest.approx(joints, abs=1e-6)


def test_backward_is_vectorised_and_says_nan_where_out_of_reach() -> None:
    """A grid of places keeps its shape; places beyond the arm are NaN, without a warning."""
    places = np.array([[[127.0, 0, 0], [900.0, 0, 0]], [[200.0, 50, 40], [0.0, 0, 2000]]])
    joints = backward(MODEL, places, -np.pi / 2, 0.0)
    assert joints.shape == (2, 2, 5)
    assert np.isfinite(joints[:, :, 1]).tolist() == [[True, False], [True, False]]


@settings(deadline=None)
@given(st.floats(-400, 400))
def test_the_gripper_follows_the_elbow(steps: float) -> None:
    """Moving motors 3 and 6 alike keeps the opening; motor 3 alone changes it."""
    start = np.array([0.0, -500, 900, 384, 384, 900 + 146])
    _, before = joints_from_steps(MODEL, start)
    _, held = joints_from_steps(MODEL, start + np.array([0, 0, steps, 0, 0, steps]))
    _, alone = joints_from_steps(MODEL, start + np.array([0, 0, steps, 0, 0, 0]))
    assert float(held) == pytest.approx(float(before), abs=1e-9)
    assert float(alone - before) == pytest.approx(-steps / MODEL.grip_steps_per_mm, abs=1e-9)


def test_the_cable_keeps_the_forearms_elevation() -> None:
    """The shoulder's motor alone turns the upper arm; forearm and hand keep their elevations."""
    start = np.array([0.0, -500, 900, 384, 384, 900])
    before, _ = joints_from_steps(MODEL, start)
    after, _ = joints_from_steps(MODEL, start + np.array([0, 100, 0, 0, 0, 0]))
    assert after[1] < before[1]
    assert after[[0, 2, 3, 4]] == pytest.approx(before[[0, 2, 3, 4]])


@settings(deadline=None)
@given(inside)
def test_the_skeleton_has_the_arms_lengths(joints: Array) -> None:
    """Shoulder, elbow, wrist and fingertip are as far apart as the parts are long."""
    bones = np.linalg.norm(np.diff(skeleton(MODEL, joints), axis=0), axis=-1)
    assert bones == pytest.approx([MODEL.upper_arm, MODEL.forearm, MODEL.hand])


@pytest.mark.parametrize(
    ("joints_deg", "name"),
    [
        ((91, 60, -40, -90, 0), "base"),
        ((0, 145, 20, 0, 0), "shoulder"),
        ((0, 120, -31, -90, 0), "elbow"),
        ((0, 60, 1, -90, 0), "wrist"),
        ((0, 60, -40, -90, 361), "roll"),
    ],
)
def test_each_range_is_held_and_named(joints_deg: tuple[float, ...], name: str) -> None:
    """A joint one degree beyond its range is found and named with its angle."""
    broken = broken_limits(MODEL, np.radians(joints_deg))
    assert any(text.startswith(name) for text in broken), broken


def test_reach_refuses_with_the_place_and_the_reason() -> None:
    """Out of reach, out of range and too close to the body each say so."""
    with pytest.raises(Unreachable, match=r"\(600\.0, 0\.0, 0\.0\) mm .* out of reach"):
        reach(MODEL, [600, 0, 0], -np.pi / 2, 0.0)
    with pytest.raises(Unreachable, match="closer than 57 mm"):
        reach(MODEL, [50, 0, 200], -np.pi / 2, 0.0)
    narrow = ArmModel(limits=ArmLimits(base=(-0.1, 0.1)))
    with pytest.raises(Unreachable, match=r"base 26\.6 deg is outside -6 to 6 deg"):
        reach(narrow, [200, 100, 50], -np.pi / 2, 0.0)


def test_room_to_spare_is_named_as_the_limit_it_makes() -> None:
    """What is within its limits but too near an end is told the range that was left."""
    joints = [MODEL.limits.base[1] - 0.001, 0.0, 0.0, 0.0, 0.0]
    assert not any("base" in text for text in broken_limits(MODEL, joints))
    (said,) = (t for t in broken_limits(MODEL, joints, np.radians(-0.3)) if "base" in t)
    assert said == "base 89.94 deg is outside -89.70 to 89.70 deg, 0.3 deg within its ends"


def test_the_published_start_pose_is_within_every_limit() -> None:
    """The paper's start pose is reachable."""
    assert not broken_limits(MODEL, reach(MODEL, [127, 0, 0], -np.pi / 2, 0.0))
