"""Straight paths: true to the line, short enough, within the motors' rates, never drifting."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.geometry.arm import ArmModel, Unreachable, forward, joints_from_steps
from legato.geometry.motion import (
    SPEEDS,
    StepMove,
    Steps,
    ToolPose,
    move_between,
    pose_steps,
    rate_of,
    rounded,
    speed_for,
    straight_path,
)

MODEL = ArmModel()
RATES = np.array(MODEL.rates)

poses = st.builds(
    ToolPose,
    x=st.floats(110, 230), y=st.floats(-120, 150), z=st.floats(5, 150),
    pitch=st.floats(-1.6, -1.45), roll=st.floats(-1.0, 1.0), grip=st.floats(0, 20),
)  # fmt: skip
steps = st.tuples(*[st.integers(-300, 300)] * 6)


def whole(pose: ToolPose) -> Steps:
    """Return a pose's half-steps, rounded as a path's are."""
    return next(iter(rounded(pose_steps(MODEL, pose.vector())[None])))


def test_speed_183_is_the_manuals_rate() -> None:
    """The one published calibration point holds."""
    assert rate_of(183) == pytest.approx(141.0)


@settings(deadline=None)
@given(steps, st.floats(0.2, 1.0))
def test_no_motor_exceeds_its_rate(move: tuple[int, ...], scale: float) -> None:
    """The chosen speed keeps every motor within its share, and the next one up would not."""
    speed = speed_for(move, np.asarray(MODEL.rates) * scale)
    a, b, c, d, e, f = move
    rates = StepMove((a, b, c, d, e, f), speed).rates()
    slowest = rate_of(SPEEDS[0])
    if speed > SPEEDS[0]:
        assert (rates <= RATES * scale * (1 + 1e-9)).all()
    else:
        assert rates.max() <= slowest * (1 + 1e-9)
    if SPEEDS[0] < speed < SPEEDS[1]:
        faster = StepMove((a, b, c, d, e, f), speed + 1).rates()
        assert (faster > RATES * scale).any()


def test_a_move_that_moves_nothing_takes_no_time() -> None:
    """Equal ends give a command of zero steps and no duration."""
    move = move_between(MODEL, np.arange(6), np.arange(6))
    assert move.steps == (0, 0, 0, 0, 0, 0)
    assert move.duration == 0.0


@settings(max_examples=40, deadline=None)
@given(poses, poses)
def test_paths_are_straight_short_and_end_where_asked(start: ToolPose, end: ToolPose) -> None:
    """Chord within 0.25 mm everywhere, each command within 0.2 s at its own speed, exact end."""
    path = straight_path(MODEL, start, end)
    if start == end:
        assert len(path) == 0
        return
    assert path[-1] == pytest.approx(pose_steps(MODEL, end.vector()))
    line = end.xyz - start.xyz
    length = max(float(np.linalg.norm(line)), 1e-9)
    before = pose_steps(MODEL, start.vector())
    for point in path:
        between = before + np.linspace(0.0, 1.0, 9)[:, None] * (point - before)
        place, _, _ = forward(MODEL, joints_from_steps(MODEL, between)[0])
        away = np.cross(place - start.xyz, line / length) if length > 1e-6 else place - start.xyz
        assert np.linalg.norm(away, axis=-1).max() <= 0.25 * 1.2
        before = point


@settings(max_examples=40, deadline=None)
@given(poses, poses, st.floats(0.4, 1.0))
def test_commands_last_no_longer_than_allowed(start: ToolPose, end: ToolPose, scale: float) -> None:
    """Rounded to half-steps and to a speed number, a command may last 0.2 s and one speed step."""
    position = whole(start)
    for target in rounded(straight_path(MODEL, start, end, scale=scale)):
        move = move_between(MODEL, position, target, scale)
        assert move.duration <= 0.2 * 1.06
        position = target


@settings(max_examples=40, deadline=None)
@given(st.lists(poses, min_size=2, max_size=5))
def test_rounding_never_adds_up(stops: list[ToolPose]) -> None:
    """After any tour the sum of commands is the last target's own rounding.

    On the way the gripper's motor keeps its distance to the elbow's.
    """
    position = whole(stops[0])
    registers = np.array(position)
    for start, end in pairwise(stops):
        for target in rounded(straight_path(MODEL, start, end)):
            registers += np.array(move_between(MODEL, position, target).steps)
            position = target
            assert abs((registers[5] - registers[2]) / MODEL.grip_steps_per_mm) <= 20 + 0.04
    assert tuple(registers) == whole(stops[-1])


def test_a_path_out_of_reach_names_the_place() -> None:
    """A line that leaves the workspace is refused before anything moves."""
    with pytest.raises(Unreachable, match="mm: "):
        straight_path(MODEL, ToolPose(200, 0, 50), ToolPose(430, 0, 50))


def test_a_closed_gripper_stays_exactly_closed() -> None:
    """With no opening, motor 6 makes the very steps of motor 3."""
    path = straight_path(MODEL, ToolPose(127, 0, 150), ToolPose(127, 100, 70))
    position = whole(ToolPose(127, 0, 150))
    for target in rounded(path):
        move = move_between(MODEL, position, target)
        assert move.steps[5] == move.steps[2]
        position = target


@settings(deadline=None)
@given(start=poses, end=poses, ratio=st.sampled_from([-1.0, 0.0, 0.5, 1.0, 1.25]))
def test_the_gripper_follows_the_elbow_by_what_the_model_says(
    start: ToolPose, end: ToolPose, ratio: float
) -> None:
    """Motor 6 makes its share of motor 3's steps to half a step: the opening stays as it is."""
    model = replace(MODEL, grip_per_elbow=ratio)
    closed = (replace(pose, grip=0.0) for pose in (start, end))
    path = straight_path(model, *closed)
    for one, two, three, four, five, six in rounded(path, ratio):
        assert abs(six - ratio * three) <= 0.5 + 1e-6
        _, grip = joints_from_steps(model, (one, two, three, four, five, six))
        assert abs(float(grip)) <= 0.5 / model.grip_steps_per_mm + 1e-6


@settings(deadline=None)
@given(start=poses, end=poses)
def test_no_more_commands_than_in_equal_lengths(start: ToolPose, end: ToolPose) -> None:
    """Cut where equal times end if that takes fewer; the search may miss the least by one."""
    path = straight_path(MODEL, start, end)
    even = straight_path(MODEL, start, end, pieces=2)
    assert len(path) <= max(len(even), 2) + 1


def test_a_line_along_which_the_joints_quicken_takes_fewer_commands_so() -> None:
    """Toward the base the elbow turns faster and faster: equal lengths would waste commands."""
    start, end = ToolPose(300.0, 0.0, 150.0), ToolPose(90.0, 0.0, 150.0)
    path = straight_path(MODEL, start, end)
    assert len(path) < len(straight_path(MODEL, start, end, pieces=2))
