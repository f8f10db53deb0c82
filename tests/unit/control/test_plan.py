"""Stations, lead-ins and the roll of the fingers."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.control.perceive import Calibration
from legato.control.plan import finger_roll, plan_stations, transit
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import drawn_pose
from legato.geometry.arm import backward
from legato.geometry.motion import ToolPose
from legato.geometry.transforms import Array, apply, rotation_from_vector, transform
from tests.unit.control.cell import HOME, Bench, calibration_of, cell_settings

angles = st.floats(-np.pi, np.pi)
SETTINGS = cell_settings()
FOUND = calibration_of(SETTINGS, drawn_pose(SimSettings(), np.random.default_rng(0)))


def stated(pose: Array) -> Calibration:
    """Return a calibration that states another pose."""
    places = SETTINGS.leg.surface_point(np.array(SETTINGS.stations))
    normals = np.tile(pose[:3, :3] @ SETTINGS.leg.surface_normal(), (len(places), 1))
    return replace(FOUND, world_from_object=pose, stations=apply(pose, places), normals=normals)


@given(base=st.floats(-1.5, 1.5), yaw=angles)
def test_the_roll_aligns_the_fingers_with_the_leg(base: float, yaw: float) -> None:
    """At pitch -90 the tool's y heads along the leg's axis, whatever base angle and yaw."""
    roll = finger_roll(base, yaw)
    assert -np.pi <= roll <= np.pi
    heading = base + np.pi / 2 - roll
    assert np.isclose(np.cos(heading - yaw), 1.0)


def test_the_descent_leaves_the_base_motor_alone(bench: Callable[..., Bench]) -> None:
    """Approach, surface and deepest point share one base angle, and the line meets the station."""
    cell = bench(3)
    calibration = cell.memory.calibration
    assert calibration is not None
    for plan, place in zip(
        plan_stations(cell.settings, calibration), calibration.stations, strict=True
    ):
        angles = [np.arctan2(p.y, p.x) for p in (plan.approach, plan.at(0.0), plan.at(-3.0))]
        assert np.ptp(angles) < 1e-12
        assert np.allclose(plan.at(0.0).xyz, place)
        assert np.isclose(plan.height(plan.approach.xyz), cell.settings.approach)
        assert plan.up[2] > 0.9


def test_the_lead_in_lets_base_and_wrist_motors_end_forward(bench: Callable[..., Bench]) -> None:
    """From lead-in to approach motors 1, 4 and 5 all count upward, by more than their play."""
    from legato.geometry.motion import pose_steps

    cell = bench(2)
    calibration = cell.memory.calibration
    assert calibration is not None
    for plan in plan_stations(cell.settings, calibration):
        ends = [plan.lead_in.vector(), plan.approach.vector()]
        forward = np.diff(pose_steps(cell.settings.arm, np.array(ends)), axis=0)[0]
        assert (forward[[0, 3, 4]] > 6.0).all()


def test_transit_goes_up_first_and_down_last() -> None:
    """A transit rises to the height of home before it crosses, and skips what it need not do."""
    settings = cell_settings()
    here, goal = ToolPose(120.0, -60.0, 70.0), ToolPose(130.0, 60.0, 75.0)
    way = transit(settings, here, goal)
    assert [p.z for p in way] == [HOME.z, HOME.z, goal.z]
    assert (way[0].x, way[0].y) == (here.x, here.y)
    assert way[-1] == goal
    assert transit(settings, goal, goal)[-1] == goal
    assert transit(settings, HOME, HOME) == []
    assert np.isfinite(backward(settings.arm, way[1].xyz, way[1].pitch, way[1].roll)).all()


@settings(deadline=None)
@given(yaw=angles)
def test_the_hand_never_turns_the_long_way_round_between_stations(yaw: float) -> None:
    """Whatever the leg's heading, rolls of successive stations are near, and align the fingers."""
    pose = transform(rotation_from_vector([0.0, 0.0, yaw]), [180.0, 0.0, 40.0])
    plans = plan_stations(SETTINGS, stated(pose))
    rolls = np.array([p.approach.roll for p in plans])
    assert np.abs(np.diff(rolls)).max() <= np.pi
    base = [np.arctan2(p.approach.y, p.approach.x) for p in plans]
    assert np.allclose(np.cos(np.array(base) + np.pi / 2 - rolls - yaw), 1.0)
