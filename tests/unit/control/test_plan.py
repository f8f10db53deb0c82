"""Stations, lead-ins and the roll of the fingers."""

from collections.abc import Callable

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from legato.control.plan import finger_roll, plan_stations, transit
from legato.geometry.arm import backward
from legato.geometry.motion import ToolPose
from tests.unit.control.cell import HOME, Bench, cell_settings

angles = st.floats(-np.pi, np.pi)


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
