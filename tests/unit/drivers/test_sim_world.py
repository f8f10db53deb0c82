"""The simulated world: what is drawn, what is felt, and what it holds against whoever moves it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.drivers.sim.clock import ManualClock
from legato.drivers.sim.motors import Motors
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import World
from legato.geometry.arm import reach
from legato.geometry.motion import (
    StepMove,
    Steps,
)
from legato.geometry.transforms import angle_between, apply, invert
from tests.unit.drivers.sim_cell import FAR, HOME, LEG, MODEL, SLOW, Cell, only, whole


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_the_leg_lies_within_its_scatter(seed: int) -> None:
    """Each seed draws one pose: within the scatter of place and angles, the same every time."""
    true = SimSettings(seed=seed)
    a, b = (World(true, LEG, MODEL, ManualClock()).world_from_object for _ in range(2))
    assert (a == b).all()
    shift = np.abs(a[:3, 3] - true.leg_at_mm)
    assert (shift <= [6.0, 6.0, 2.0]).all()
    middle = Cell().world.world_from_object
    assert np.degrees(angle_between(a[:3, :3], middle[:3, :3])) <= np.hypot(5.0, np.hypot(2.5, 2.5))


def test_seeds_differ_and_no_scatter_means_the_configured_pose() -> None:
    """The configured pose is the paper's: axis toward +y, rising, the face toward the camera."""
    drawn = [World(SimSettings(seed=s), LEG, MODEL, ManualClock()) for s in (1, 2)]
    assert not np.allclose(drawn[0].world_from_object, drawn[1].world_from_object)
    pose = Cell().world.world_from_object
    rise = np.radians(5.75)
    assert pose[:3, 3] == pytest.approx((124.29, -64.03, 30.52))
    assert pose[:3, 0] == pytest.approx((0.0, np.cos(rise), np.sin(rise)), abs=1e-12)
    assert pose[:3, 1] == pytest.approx((-1.0, 0.0, 0.0), abs=1e-12)


def test_the_camera_looks_where_it_is_told() -> None:
    """The target lies on the camera's axis, in front of it."""
    world = Cell().world
    seen = apply(invert(world.world_from_camera), [world.settings.camera_looks_at_mm])[0]
    assert seen[:2] == pytest.approx((0.0, 0.0), abs=1e-9)
    assert seen[2] > 0.0


@settings(max_examples=20, deadline=None)
@given(st.floats(110, 180), st.floats(-100, 120), st.floats(100, 160))
def test_without_play_the_tip_goes_where_the_steps_say(x: float, y: float, z: float) -> None:
    """Half-steps place the fingertip to within their own rounding; registers are their sum."""
    cell = Cell()
    cell.go(x, y, z)
    assert cell.tip == pytest.approx((x, y, z), abs=0.35)
    assert np.array_equal(cell.world.registers, np.subtract(cell.at, whole(HOME)))
    assert cell.breaches == []


def test_a_motion_takes_its_own_time() -> None:
    """The clock moves on by the longest motor's steps over its rate."""
    cell = Cell()
    move = StepMove(only(m1=141), 183)
    cell.world.step(move)
    assert cell.clock.monotonic() == pytest.approx(1.0)


def turn(motors: Motors, motor: int, steps: int) -> float:
    """Turn one motor and return its output, in half-steps from the start."""
    move = StepMove(only(**{f"m{motor}": steps}), SLOW)
    travel, lost = motors.travel(move)
    assert not lost
    motors.settle(move, travel, 1.0)
    return float(motors.output[motor - 1])


@pytest.mark.parametrize("motor", [1, 2, 3, 4, 5])
def test_backlash_swallows_the_first_steps_back(motor: int) -> None:
    """Forward moves act at once, since the play is taken up; backward ones lose its width."""
    motors = Motors(MODEL, reach(MODEL, HOME.xyz, HOME.pitch, HOME.roll), 6.0)
    start = float(motors.output[motor - 1])
    for steps, moved in [(10, 10), (-5, 10), (-3, 8), (-10, -2), (4, -2), (8, 4)]:
        assert turn(motors, motor, steps) - start == pytest.approx(moved)
    assert motors.registers[motor - 1] == 4


def test_the_grippers_motor_has_no_play() -> None:
    """Motor 6 turns back at once."""
    motors = Motors(MODEL, reach(MODEL, HOME.xyz, HOME.pitch, HOME.roll), 6.0)
    start = float(motors.output[5])
    assert turn(motors, 6, 10) - start == pytest.approx(10)
    assert turn(motors, 6, -1) - start == pytest.approx(9)


def test_a_motor_asked_for_too_much_loses_steps() -> None:
    """The registers believe the command; the arm falls behind, and the breach names the motor."""
    cell = Cell()
    cell.world.step(StepMove(only(m1=100), 240))
    assert cell.world.registers[0] == 100
    kept = np.trunc(100 * 473 / (10152 / 15))
    assert np.arctan2(cell.tip[1], cell.tip[0]) == pytest.approx(kept * 2.0 * np.pi / 7072)
    (breach,) = cell.breaches
    assert breach["kind"] == "rate"
    assert "motor 1 (base)" in breach["what"]


@pytest.mark.parametrize(
    ("steps", "name"),
    [
        (only(m1=2500), "base"),
        (only(m2=-2500), "shoulder"),
        (only(m3=-1650, m4=-600, m5=-600, m6=-1650), "elbow"),
        (only(m4=400, m5=400), "wrist"),
        (only(m4=2000, m5=-2000), "roll"),
    ],
)
def test_a_joint_stops_at_its_end(steps: Steps, name: str) -> None:
    """Beyond a joint's range the arm stands still, loses the steps, and the breach says which."""
    cell = Cell()
    cell.world.place_leg(FAR)
    cell.world.step(StepMove(steps, SLOW))
    assert cell.world.registers == steps
    limits = [b for b in cell.breaches if b["kind"] == "limit"]
    assert [b["what"].split()[0] for b in limits] == [name]
    before = cell.tip
    cell.world.step(StepMove(steps, SLOW))
    assert cell.tip == pytest.approx(before, abs=1.0)
