"""The jobs as a whole: their states, their effects, and what stop and pause do to them."""

from collections.abc import Callable

import numpy as np
import pytest

from legato.control import effects as do
from legato.control.jobs import precondition
from legato.control.memory import Memory
from legato.control.settings import Workspace
from legato.geometry.motion import ToolPose
from legato.geometry.transforms import rotation_from_vector, transform
from tests.unit.control.cell import HOME, STATIONS, Bench, cell_settings, steps_at

Maker = Callable[..., Bench]


def stop_after(count: int) -> Callable[[do.Effect], Exception | None]:
    """Return an interrupt that asks for a stop, once, before motion number `count`."""
    return _after(count, do.StopRequested)


def pause_after(count: int) -> Callable[[do.Effect], Exception | None]:
    """Return an interrupt that asks for a pause, once, before motion number `count`."""
    return _after(count, do.PauseRequested)


def _after(count: int, error: type[Exception]) -> Callable[[do.Effect], Exception | None]:
    seen = {"moves": 0, "done": 0}

    def interrupt(effect: do.Effect) -> Exception | None:
        seen["moves"] += isinstance(effect, do.Move)
        if seen["moves"] > count and not seen["done"]:
            seen["done"] = 1
            return error()
        return None

    return interrupt


def test_a_run_enters_the_designed_states_and_ends_at_home(bench: Maker) -> None:
    """A whole run goes capture to massage and back, and leaves the arm parked."""
    cell = bench()
    assert cell.run("run") == "done"
    passes = [f"massage_{s:g}" for s in STATIONS]
    assert cell.entered() == [
        "capture", "calibrate", "verify", "move_home", *passes, "move_home",
    ]  # fmt: skip
    assert cell.memory.steps() == steps_at(cell.settings, HOME)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_stroke_touches_its_station(bench: Maker, seed: int) -> None:
    """With a true pose each touch lies within 0.5 mm of its station, backlash and all."""
    cell = bench(seed)
    cell.run("massage")
    touches, contacts = cell.touches(), cell.contacts()
    assert len(touches) == len(contacts) == 12
    for touch, contact in zip(touches, contacts, strict=True):
        station = cell.settings.leg.surface_point(np.array(contact["station_mm"]))
        assert np.linalg.norm(np.array(touch["object_mm"]) - station) < 0.5
        assert abs(contact["contact_mm"]) < 1.0
    assert cell.world.testimony()["breaches"] == []


@pytest.mark.parametrize("count", [0, 5, 20, 60, 150, 300])
def test_a_stop_retracts_and_ends(bench: Maker, count: int) -> None:
    """After a stop the only motion is the retract to the approach height, then stopped."""
    cell = bench()
    cell.interrupt = stop_after(count)
    assert cell.run("massage") == "stopped"
    after = cell.moves()[count:]
    assert all(m.why is do.Why.RETRACT for m in after)
    assert cell.entered()[-1] == "stopping"
    assert not cell.world.switch_closed


@pytest.mark.parametrize("count", [3, 30, 100])
def test_a_pause_retracts_holds_and_repeats_the_stroke(bench: Maker, count: int) -> None:
    """A paused massage goes on with the stroke that was broken off, and makes them all."""
    cell = bench()
    cell.interrupt = pause_after(count)
    assert cell.run("massage") == "done"
    holds = [i for i, e in enumerate(cell.log) if isinstance(e, do.Hold)]
    assert len(holds) == 1
    assert cell.log[holds[0] - 1] == do.Enter("paused")
    strokes = {(c["station_mm"], c["stroke"]) for c in cell.contacts()}
    assert len(strokes) == 12


def test_a_leg_that_sank_is_a_late_contact_and_the_arm_is_up(bench: Maker) -> None:
    """No contact within the window is a fault, after a retract."""
    cell = bench()
    lower = cell.world.world_from_object.copy()
    lower[2, 3] -= 6.0
    cell.world.place_leg(lower)
    with pytest.raises(do.CellFault, match="contact_late"):
        cell.run("massage")
    assert cell.moves()[-1].why is do.Why.RETRACT
    assert cell.touches() == []
    again = precondition("massage", cell.settings, cell.memory, 0.0)
    assert again is not None, "a calibration that led to a fault counts as verified"


@pytest.mark.parametrize("rise", [5.0, 9.8, 10.5, 14.0, 30.0])
def test_a_leg_that_rose_is_an_early_contact_and_the_arm_is_up(bench: Maker, rise: float) -> None:
    """Contact in the descent, before it, or on the way there: a light touch, back, and a fault.

    An arm that stands lower than it was told meets the leg in the same way.
    """
    cell = bench()
    higher = cell.world.world_from_object.copy()
    higher[2, 3] += rise
    cell.world.place_leg(higher)
    with pytest.raises(do.CellFault, match="contact_early"):
        cell.run("massage")
    assert not cell.world.switch_closed
    assert cell.moves()[-1].why is do.Why.RETRACT
    assert all(touch["ended_s"] is not None for touch in cell.touches())
    assert "stall" not in str(cell.world.testimony()["breaches"])


def test_who_stands_pressed_into_the_leg_may_leave_it(bench: Maker) -> None:
    """After an emergency stop in a press the way home begins with the switch closed."""
    cell = bench()
    stopped = RuntimeError("estop")

    def stop(effect: do.Effect) -> Exception | None:
        return stopped if isinstance(effect, do.Dwell) else None

    cell.interrupt = stop
    with pytest.raises(RuntimeError):
        cell.run("massage")
    cell.interrupt = lambda _: None
    assert cell.run("home") == "done"
    assert not cell.world.switch_closed


def test_trouble_that_is_not_the_arms_lets_it_come_off_the_leg(bench: Maker) -> None:
    """Whatever fails beside the arm while the fingertip is down, the retract is made first."""
    cell = bench()
    asked = [0]

    def trouble(effect: do.Effect) -> Exception | None:
        asked[0] += isinstance(effect, do.Dwell)
        return OSError("no space left") if asked[0] == 1 and isinstance(effect, do.Dwell) else None

    cell.interrupt = trouble
    with pytest.raises(OSError, match="no space"):
        cell.run("massage")
    assert cell.moves()[-1].why is do.Why.RETRACT
    assert not cell.world.switch_closed


def test_a_leg_out_of_reach_is_refused_by_verify_before_any_motion(bench: Maker) -> None:
    """A leg behind the base's range is named with station and joint; nothing moves."""
    turn = transform(rotation_from_vector([0.0, 0.0, -1.2]), [0.0, 0.0, 0.0])
    camera = cell_settings().world_from_camera
    room = Workspace((-300.0, -300.0, 0.0), (330.0, 300.0, 300.0))
    cell = bench(workspace=room, world_from_camera=turn @ camera)
    cell.world.place_leg(turn @ cell.world.world_from_object)
    with pytest.raises(do.Refused) as refused:
        cell.run("run")
    assert any("station 7 mm" in r and "base" in r for r in refused.value.reasons)
    assert cell.moves() == []


def test_a_leg_moved_between_the_pictures_is_refused(bench: Maker) -> None:
    """The second picture must agree with the first."""
    cell = bench()

    def nudge(effect: do.Effect) -> None:
        if effect == do.Grab("verify"):
            moved = cell.world.world_from_object.copy()
            moved[0, 3] += 3.0
            cell.world.place_leg(moved)

    cell.interrupt = nudge
    with pytest.raises(do.Refused, match="second picture"):
        cell.run("run")


def test_each_job_says_what_it_lacks(bench: Maker) -> None:
    """Unreferenced arm, no picture, no calibration, one too old: each named with what to do."""
    settings = cell_settings()
    empty = Memory()
    for job, word in [
        ("run", "not referenced"),
        ("home", "not referenced"),
        ("calibrate", "no picture"),
        ("verify", "no calibration"),
        ("massage", "not referenced"),
    ]:
        no = precondition(job, settings, empty, 0.0)
        assert no is not None
        assert word in no.reason
        assert no.hint
    assert precondition("capture", settings, empty, 0.0) is None
    full = bench().memory
    assert precondition("massage", settings, full, 10.0) is None
    late = precondition("massage", settings, full, settings.calibration.fresh_s + 1.0)
    assert late is not None
    assert "old" in late.reason


def test_a_massage_whose_way_to_the_leg_is_not_clear_is_refused_before_it_moves(
    bench: Maker,
) -> None:
    """Verify rehearses from home; an arm that stands beside the leg may not cut through it."""
    cell = bench()
    calibration = cell.memory.calibration
    assert calibration is not None
    beside = ToolPose(88.0, -20.0, 62.0, pitch=-0.6)
    cell.memory.reference = steps_at(cell.settings, beside)
    with pytest.raises(do.Refused, match="the way to station 7 mm is not clear"):
        cell.run("massage")
    assert cell.moves() == []
