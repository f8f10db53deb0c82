"""What the simulated world feels: presses, pushes, other touches, and what it testifies."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.drivers.sim.ledger import KEPT, Contact, Ledger, Walk
from legato.geometry.arm import Unreachable
from legato.geometry.motion import (
    StepMove,
    ToolPose,
)
from legato.geometry.transforms import Array, NotARotation, apply, transform
from tests.unit.drivers.sim_cell import FAR, HOME, LEG, SLOW, Cell, only, whole


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
