"""The kinds of stroke, and what each records and refuses."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from legato.control import effects as do
from legato.control.settings import DrawSettings, MassageSettings
from tests.unit.control.cell import Bench

Maker = Callable[..., Bench]


def drawing(**changes: Any) -> MassageSettings:
    """Return a massage of one press and one draw a station."""
    return MassageSettings(strokes=1, draw=DrawSettings(count=1), **changes)


def test_a_draw_stays_in_touch_from_station_to_station(bench: Maker) -> None:
    """Drawing keeps the fingertip in the leg, near its depth, and breaks nothing."""
    cell = bench(massage=drawing())
    assert cell.run("massage") == "done"
    touches = cell.touches()
    assert len(touches) == len(cell.contacts()) == 4 + 3
    assert cell.world.testimony()["breaches"] == []
    lengths = [m for m in cell.moves() if m.why is do.Why.DRAW]
    assert {(m.station, m.until) for m in lengths} == {(7, 67), (67, 127), (127, 187)}
    # One touch a draw: the fingertip never came off; and it was no deeper than the envelope allows.
    assert all(0.5 < t["depth_mm"] < 3.0 for t in touches)


@pytest.mark.parametrize("settings", [{"press_mm": 1.5}, {"press_steps": 3, "press_mm": 4.0}])
def test_a_press_goes_to_a_depth_or_a_count_of_steps(bench: Maker, settings: Any) -> None:
    """Three steps of half a millimetre beyond contact end where a press of 1.5 mm ends."""
    cell = bench(massage=MassageSettings(strokes=1, **settings))
    assert cell.run("massage") == "done"
    assert cell.world.testimony()["breaches"] == []
    depths = [t["depth_mm"] for t in cell.touches()]
    assert len(depths) == 4
    assert all(1.1 < depth < 1.9 for depth in depths)
    presses = [m for m in cell.moves() if m.why is do.Why.PRESS]
    assert len(presses) == 4 * settings.get("press_steps", 1)


def test_a_draw_keeps_to_its_speed(bench: Maker) -> None:
    """The fingertip goes along the leg at most as fast as configured."""
    cell = bench(massage=drawing())
    cell.run("massage")
    moves = [m for m in cell.moves() if m.why is do.Why.DRAW]
    seconds = sum(m.move.duration for m in moves)
    assert 180.0 / seconds <= 20.0 * 1.02
    assert max(m.move.duration for m in moves) <= 0.2


@pytest.mark.parametrize("count", [60, 70, 80, 95])
def test_a_stop_while_drawing_lifts_straight_off(bench: Maker, count: int) -> None:
    """A stop at any moment of a draw goes up from where it was, to the approach height."""
    cell = bench(massage=drawing())
    seen = [0]

    def stop(effect: do.Effect) -> Exception | None:
        seen[0] += isinstance(effect, do.Move)
        return do.StopRequested() if seen[0] == count and isinstance(effect, do.Move) else None

    cell.interrupt = stop
    assert cell.run("massage") == "stopped"
    assert all(m.why is do.Why.RETRACT for m in cell.moves()[count - 1 :])
    assert not cell.world.switch_closed


def test_a_leg_that_sinks_between_strokes_has_moved(bench: Maker) -> None:
    """A contact that wanders from the station's first one is fault leg_moved, after a retract."""
    cell = bench(massage=MassageSettings(drift_mm=0.7))

    def sink(effect: do.Effect) -> None:
        if isinstance(effect, do.Record) and effect.kind == "progress" and effect.data["done"] == 2:
            lower = cell.world.world_from_object.copy()
            lower[2, 3] -= 1.3
            cell.world.place_leg(lower)

    cell.interrupt = sink
    with pytest.raises(do.CellFault, match="leg_moved"):
        cell.run("massage")
    assert cell.moves()[-1].why is do.Why.RETRACT
    assert len(cell.contacts()) == 2


def test_the_hand_leans_along_the_normal_where_asked(bench: Maker) -> None:
    """With follow_normal the pitch is the surface's, and the touches stay on their stations."""
    cell = bench(massage=MassageSettings(strokes=1, follow_normal=True), sim={"leg_roll_deg": 8.0})
    assert cell.run("massage") == "done"
    assert cell.world.testimony()["breaches"] == []
    pitches = {round(float(np.degrees(p)), 1) for p in _pitches(cell)}
    assert any(abs(p + 90.0) > 3.0 for p in pitches)
    for touch, contact in zip(cell.touches(), cell.contacts(), strict=True):
        station = cell.settings.leg.surface_point(np.array(contact["station_mm"]))
        assert np.linalg.norm(np.array(touch["object_mm"]) - station) < 0.6


def _pitches(cell: Bench) -> list[float]:
    from legato.geometry.arm import joints_from_steps

    pressed = [m.target for m in cell.moves() if m.why is do.Why.PRESS]
    return [float(joints_from_steps(cell.settings.arm, t)[0][3]) for t in pressed]
