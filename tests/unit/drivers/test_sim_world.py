"""The simulated world: what is drawn, what is felt, and what it holds against whoever moves it."""

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.drivers.sim.clock import ManualClock
from legato.drivers.sim.ledger import KEPT, Contact, Ledger, Walk
from legato.drivers.sim.motors import Motors
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import World
from legato.geometry.arm import ArmModel, Unreachable, reach
from legato.geometry.leg import Leg
from legato.geometry.motion import (
    StepMove,
    Steps,
    ToolPose,
    move_between,
    pose_steps,
    rounded,
    straight_path,
)
from legato.geometry.transforms import Array, NotARotation, angle_between, apply, invert, transform

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


def press(cell: Cell, along: float, depth: float) -> Array:
    """Press straight down at a station from 10 mm above it; return the surface's place."""
    place = apply(cell.world.world_from_object, LEG.surface_point([along]))[0]
    cell.go(place[0], place[1], 140.0)
    cell.go(place[0], place[1], place[2] + 10.0)
    cell.go(place[0], place[1], place[2] - depth)
    return np.asarray(place)


@pytest.mark.parametrize("along", [7.0, 67.0, 127.0, 187.0])
def test_a_press_is_felt_and_witnessed(along: float) -> None:
    """The switch closes under the press and opens after it.

    The witness knows the place, depth and force, and registers at touch and switch.
    """
    cell = Cell()
    place = press(cell, along, 1.5)
    assert cell.world.switch_closed
    assert cell.touches[-1]["ended_s"] is None
    cell.go(place[0], place[1], place[2] + 10.0)
    assert not cell.world.switch_closed
    (touch,) = cell.touches
    assert touch["surface"] == "leg"
    assert touch["world_mm"] == pytest.approx(place, abs=0.4)
    assert touch["along_mm"] == pytest.approx(along, abs=0.4)
    assert touch["angle_deg"] == pytest.approx(0.0, abs=2.0)
    clearance = LEG.clearance(np.array(touch["object_mm"]))
    assert float(clearance) == pytest.approx(0.0, abs=2e-3)
    assert touch["depth_mm"] == pytest.approx(1.5, abs=0.4)
    assert touch["force_n"] == pytest.approx(2.0 * touch["depth_mm"])
    assert touch["began_s"] <= touch["switch_s"] <= touch["ended_s"]
    assert len(touch["registers"]) == len(touch["switch_registers"]) == 6
    assert cell.breaches == []


def test_the_switch_needs_its_force() -> None:
    """A touch too light for the switch is witnessed all the same, and not told to the arm."""
    cell = Cell(switch_n=3.0)
    press(cell, 67.0, 0.6)
    assert not cell.world.switch_closed
    (touch,) = cell.touches
    assert touch["switch_s"] is None
    assert touch["force_n"] < 3.0


def test_a_hard_push_stalls_the_motors() -> None:
    """The tip goes no deeper than the stall force allows, however often it is asked."""
    cell = Cell(stall_n=4.0)
    press(cell, 67.0, 5.0)
    assert any(b["kind"] == "stall" for b in cell.breaches)
    assert cell.touches[0]["force_n"] <= 4.0 + 1e-9
    assert cell.touches[0]["force_n"] > 3.5
    gone = np.subtract(cell.at, whole(HOME))
    assert np.array_equal(cell.world.registers, gone)  # the registers know nothing of it


def test_the_table_is_touched_too() -> None:
    """On an empty table the fingertip's touch of the wood closes the switch."""
    cell = Cell()
    cell.world.place_leg(FAR)
    cell.go(127.0, 0.0, 5.0)
    cell.go(127.0, 0.0, -0.8)
    (touch,) = cell.touches
    assert touch["surface"] == "table"
    assert touch["world_mm"][2] == pytest.approx(0.0, abs=1e-3)
    assert cell.world.switch_closed


def test_a_pass_through_the_leg_is_one_touch_with_both_ends() -> None:
    """One command that dips in and out leaves a closed touch, although both its ends are clear."""
    cell = Cell(tissue_n_per_mm=0.1)
    place = apply(cell.world.world_from_object, LEG.surface_point([67.0]))[0]
    cell.go(place[0] - 20.0, place[1], 140.0)
    cell.go(place[0] - 20.0, place[1], place[2] - 1.0)
    target = whole(ToolPose(place[0] + 20.0, place[1], place[2] - 1.0))
    steps = np.subtract(target, cell.at)
    a, b, c, d, e, f = (int(s) for s in steps)
    cell.world.step(StepMove((a, b, c, d, e, f), SLOW))
    touches = [t for t in cell.touches if t["surface"] == "leg"]
    assert touches
    assert all(t["ended_s"] is not None for t in touches)


@pytest.mark.parametrize(
    ("leg_at", "expected"),
    [
        ((85.0, -15.0, 225.0), "hand meets leg"),
        ((160.0, -15.0, 150.0), "finger meets leg"),
        ((70.0, -15.0, 235.0), "forearm meets leg"),
    ],
)
def test_any_other_part_that_touches_is_a_breach(
    leg_at: tuple[float, float, float], expected: str
) -> None:
    """Hand, finger and forearm may not touch the leg; the first move finds it."""
    cell = Cell()
    turned = Cell().world.world_from_object[:3, :3]
    cell.world.place_leg(transform(turned, leg_at))
    cell.world.step(StepMove(only(m1=1), SLOW))
    whats = [b["what"] for b in cell.breaches if b["kind"] == "touch"]
    assert any(w.startswith(expected) for w in whats), whats
    count = len(cell.breaches)
    cell.world.step(StepMove(only(m1=1), SLOW))
    assert len(cell.breaches) == count  # one breach as long as it lasts


def test_the_hand_against_table_and_base() -> None:
    """A hand laid flat under the table's level and a forearm drawn into the base are breaches."""
    cell = Cell()
    cell.world.place_leg(FAR)
    cell.go(240.0, 0.0, 60.0)
    cell.go(240.0, 0.0, 60.0, -0.3)
    cell.go(240.0, 0.0, 2.0, -0.3)
    assert "hand meets table" in " ".join(b["what"] for b in cell.breaches)
    cell = Cell()
    cell.world.place_leg(FAR)
    cell.world.step(StepMove(only(m2=2336, m3=1515, m4=85, m5=85, m6=1515), SLOW))
    assert "forearm meets base" in " ".join(b["what"] for b in cell.breaches)


def test_a_leg_that_is_moved_is_felt_where_it_now_lies() -> None:
    """After place_leg the old surface is air, and an open touch ends with the next move."""
    cell = Cell()
    place = press(cell, 67.0, 1.0)
    cell.world.place_leg(FAR)
    cell.go(place[0], place[1], place[2] - 1.5)
    assert not cell.world.switch_closed
    assert len(cell.touches) == 1
    assert cell.touches[0]["ended_s"] is not None


def test_closing_the_gripper_closes_its_switch() -> None:
    """Motor 6 beyond shut presses finger on finger; one to one with motor 3 it does not."""
    cell = Cell()
    cell.world.step(StepMove(only(m3=50, m6=50), SLOW))
    assert not cell.world.switch_closed
    cell.world.step(StepMove(only(m6=-32), SLOW))
    assert cell.world.switch_closed


def test_testimony_is_json() -> None:
    """Records can write it as it is."""
    cell = Cell()
    press(cell, 67.0, 1.0)
    cell.world.step(StepMove(only(m1=100), 240))
    again = json.loads(json.dumps(cell.world.testimony(), allow_nan=False))
    assert set(again) == {
        "world_from_object", "world_from_camera", "touches", "breaches", "tip", "registers",
        "lost_steps",
    }  # fmt: skip


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(*[st.integers(-25, 25)] * 5), min_size=1, max_size=6))
def test_touches_do_not_depend_on_how_a_motion_is_cut(moves: list[tuple[int, ...]]) -> None:
    """Whole commands feel the leg wherever the same motion in single steps does, as deep."""
    cells = Cell(tissue_n_per_mm=0.1), Cell(tissue_n_per_mm=0.1)
    place = apply(cells[0].world.world_from_object, LEG.surface_point([67.0]))[0]
    for cell in cells:
        cell.go(place[0], place[1], place[2] + 2.0)
    for steps in moves:
        a, b, c, d, e = steps
        cells[0].world.step(StepMove((a, b, c, d, e, c), SLOW))
        for k in range(25):
            p = [round(s * (k + 1) / 25) - round(s * k / 25) for s in steps]
            cells[1].world.step(StepMove((p[0], p[1], p[2], p[3], p[4], p[2]), SLOW))
    assert cells[0].world.registers == cells[1].world.registers
    assert cells[0].tip == pytest.approx(cells[1].tip)
    depths = [max((t["depth_mm"] for t in c.touches), default=0.0) for c in cells]
    assert depths[0] == pytest.approx(depths[1], abs=0.6)


def test_bad_starts_are_refused() -> None:
    """A simulated arm cannot start where no arm can stand, nor the leg where no leg can lie."""
    with pytest.raises(Unreachable):
        Cell(arm_at_mm=(900.0, 0.0, 0.0))
    with pytest.raises(NotARotation):
        Cell().world.place_leg(np.diag([2.0, 1.0, 1.0, 1.0]))


def test_a_motor_that_slips_misses_its_next_steps_and_nobody_is_told() -> None:
    """Over several commands and either way; registers count all, only the testimony knows."""
    cell = Cell()
    before = cell.tip
    cell.world.slip(1, 30)
    for steps in (20, -25, 40):
        cell.world.step(StepMove(only(m1=steps), SLOW))
    assert cell.world.registers[0] == 35
    assert cell.world.testimony()["lost_steps"] == [30, 0, 0, 0, 0, 0]
    turned = np.arctan2(cell.tip[1], cell.tip[0]) - np.arctan2(before[1], before[0])
    assert turned * 7072 / (2 * np.pi) == pytest.approx(25)
    assert cell.breaches == []


def test_what_a_stop_a_stall_or_a_rate_takes_counts_as_lost() -> None:
    """Whatever a motor was sent and did not turn is in the testimony."""
    cell = Cell(leg_at_mm=(2000.0, 0.0, 31.0))
    cell.world.step(StepMove(only(m1=2000), SLOW))
    cell.world.step(StepMove(only(m2=-100), 245))
    lost = cell.world.testimony()["lost_steps"]
    assert isinstance(lost, list)
    assert lost[0] == pytest.approx(2000 - 7072 / 4, abs=30)
    assert lost[1] == 100 - 39  # of 405 half-steps a second at 1015
    assert {b["kind"] for b in cell.breaches} == {"limit", "rate"}


def test_a_world_that_lasts_for_months_keeps_the_latest() -> None:
    """Touches and breaches beyond some thousands do not pile up; the last ones are there."""
    ledger, contact = Ledger(), Contact("leg", 2.0, 0.3)
    for number in range(KEPT + 10):
        ledger.breach("rate", "too fast", np.zeros(3), float(number))
        times = np.array([number, number + 0.2, number + 0.4])
        walk = Walk(np.array([0.0, 0.5, 1.0]), times, np.zeros((3, 3)), lambda _: (0,) * 6)
        contact.follow(walk, np.array([1.0, -1.0, 1.0]), np.eye(4))
    assert len(ledger.breaches) == len(contact.touches) == KEPT
    assert ledger.breaches[-1]["t_s"] == KEPT + 9.0
    assert contact.touches[-1].began_s == pytest.approx(KEPT + 9.1)
