"""The safety envelope: each of its sides refuses, and names what it refuses."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from legato.control.effects import CellFault, Move, Why
from legato.control.envelope import broken, check
from legato.control.plan import plan_stations
from legato.geometry.motion import StepMove, ToolPose, move_between
from tests.unit.control.cell import HOME, Bench, cell_settings, steps_at

Maker = Callable[..., Bench]


def move_to(start: ToolPose, end: ToolPose, station: float | None = None) -> Move:
    """Return one command between two poses, however long it lasts."""
    settings = cell_settings()
    a, b = steps_at(settings, start), steps_at(settings, end)
    return Move(move_between(settings.arm, a, b, 0.8), a, b, Why.TRANSIT, station)


def test_a_short_move_in_free_air_is_allowed() -> None:
    """A few millimetres from home, away from everything, break nothing."""
    assert broken(cell_settings(), None, move_to(HOME, replace(HOME, z=147.0))) == []


def test_a_long_command_is_refused_because_a_stop_could_not_act() -> None:
    """A command may last 200 ms."""
    problems = broken(cell_settings(), None, move_to(HOME, replace(HOME, z=100.0)))
    assert any("last" in p for p in problems)


def test_a_motor_is_not_asked_for_more_than_its_rate() -> None:
    """A speed number too high for one motor is refused, naming it."""
    settings = cell_settings()
    start = steps_at(settings, HOME)
    steps = (0, 0, 0, 0, 0, 0)
    fast = StepMove((80, 0, 0, 0, 0, 0), 245)
    target = (start[0] + 80, *start[1:])
    assert any(
        "motor 1" in p for p in broken(settings, None, Move(fast, start, target, Why.TRANSIT))
    )
    other = Move(StepMove(steps, 0), start, target, Why.TRANSIT)
    assert any("do not lead" in p for p in broken(settings, None, other))


@pytest.mark.parametrize(
    ("pose", "word"),
    [
        (ToolPose(127.0, 0.0, -4.0), "below the table"),
        (ToolPose(38.0, 130.0, 150.0), "workspace"),
        (ToolPose(180.0, 0.0, 2.0, pitch=-0.1), "hand would meet the table"),
    ],
)
def test_places_outside_are_named(pose: ToolPose, word: str) -> None:
    """Table and workspace each refuse with their own words."""
    assert any(word in p for p in broken(cell_settings(), None, move_to(pose, pose)))


def test_the_fingertip_may_touch_at_its_station_only(bench: Maker) -> None:
    """The same place is allowed with its station named, refused without it or with another."""
    cell = bench()
    calibration = cell.memory.calibration
    assert calibration is not None
    plan = plan_stations(cell.settings, calibration)[1]
    pose = calibration.world_from_object
    touch = plan.at(-1.0)
    assert broken(cell.settings, pose, move_to(touch, touch, station=67.0)) == []
    assert any("within" in p for p in broken(cell.settings, pose, move_to(touch, touch)))
    other = broken(cell.settings, pose, move_to(touch, touch, station=127.0))
    assert any("not 127 mm" in p for p in other)
    deep = plan.at(-8.0)
    assert any("in the leg" in p for p in broken(cell.settings, pose, move_to(deep, deep, 67.0)))


def test_the_hand_keeps_clear_of_the_leg(bench: Maker) -> None:
    """A fingertip beside the leg with the hand leaning over it is refused."""
    cell = bench()
    farther = cell.world.world_from_object.copy()
    farther[0, 3] += 60.0
    beside = ToolPose(140.0, 0.0, 40.0, pitch=-2.4)
    problems = broken(cell.settings, farther, move_to(beside, beside))
    assert any("hand would meet the leg" in p for p in problems)


def test_check_raises_the_cells_fault_with_evidence() -> None:
    """What the daemon calls raises cause limit, and keeps the target as evidence."""
    with pytest.raises(CellFault, match="limit") as fault:
        check(cell_settings(), None, move_to(HOME, replace(HOME, z=100.0)))
    assert fault.value.evidence["problems"]
