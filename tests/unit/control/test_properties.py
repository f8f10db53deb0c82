"""What holds for every leg pose, whatever verify thinks of it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from legato.control import effects as do
from legato.control.rehearsal import dry_run
from legato.control.settings import DrawSettings, MassageSettings
from legato.geometry.arm import broken_limits, joints_from_steps
from legato.geometry.transforms import rotation_from_vector, transform
from tests.unit.control.cell import Bench, calibration_of, make_bench

spread = st.floats(-1.0, 1.0)


def placed(x: float, y: float, yaw: float, rise: float, roll: float) -> Bench:
    """Return a bench whose leg lies shifted by up to 30 and 40 mm, turned by up to 20 and 6 deg."""
    bench = make_bench(1, sim={"backlash_steps": 6.0})
    turn = np.radians([90.0 + 20.0 * yaw, 5.75 + 6.0 * rise, 6.0 * roll])
    vectors = [[0.0, 0.0, turn[0]], [0.0, -turn[1], 0.0], [turn[2], 0.0, 0.0]]
    about_z, about_y, about_x = (rotation_from_vector(v) for v in vectors)
    place = [124.0 + 30.0 * x, -64.0 + 40.0 * y, 36.0]
    bench.world.place_leg(transform(about_z @ about_y @ about_x, place))
    bench.memory.calibration = calibration_of(bench.settings, bench.world.world_from_object)
    return bench


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(x=spread, y=spread, yaw=spread, rise=spread, roll=spread)
def test_a_massage_that_verify_lets_pass_touches_its_stations_and_nothing_else(
    x: float, y: float, yaw: float, rise: float, roll: float
) -> None:
    """For any leg pose: refused with a station's name, or massaged without a single breach.

    The envelope is asked before every command, the world feels every one; the registers are the
    sum of the commands to the last half-step.
    """
    bench = placed(x, y, yaw, rise, roll)
    calibration = bench.memory.calibration
    assert calibration is not None
    problems = dry_run(calibration, bench.settings)
    if problems:
        assert all(p.startswith(("station ", "the way home")) for p in problems)
        return
    assert bench.run("massage") == "done"
    assert bench.world.testimony()["breaches"] == []
    assert {t["surface"] for t in bench.touches()} == {"leg"}
    sent = np.sum([m.move.steps for m in bench.moves()], axis=0)
    assert bench.arm.read().registers == tuple(sent)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    pose=st.tuples(spread, spread, spread, spread, spread),
    stations=st.lists(st.integers(1, 47), min_size=1, max_size=3, unique=True),
    draws=st.integers(0, 1),
    leaning=st.booleans(),
    moves=st.integers(0, 120),
    how=st.sampled_from([do.StopRequested, do.PauseRequested]),
)
def test_no_plan_leaves_the_envelope_whatever_pose_stations_stroke_and_moment_of_a_stop(
    pose: tuple[float, ...],
    stations: list[int],
    draws: int,
    leaning: bool,
    moves: int,
    how: type[Exception],
) -> None:
    """Presses and draws, upright or along the normal, broken off anywhere, and then home.

    The envelope is asked before every command and would raise; the world sees no breach and no
    touch but on the leg. Where the arm says it stands is the sum of what it was sent, and where
    the job believes it stands, after every single command.
    """
    bench = placed(*pose)
    massage = MassageSettings(strokes=1, follow_normal=leaning, draw=DrawSettings(count=draws))
    places = tuple(4.0 * s for s in sorted(stations))
    bench.settings = replace(bench.settings, massage=massage, stations=places)
    bench.memory.calibration = calibration_of(bench.settings, bench.world.world_from_object)
    if dry_run(bench.memory.calibration, bench.settings):
        return
    sent = np.zeros(6, dtype=int)
    began = bench.memory.steps()

    def interrupt(effect: do.Effect) -> Exception | None:
        nonlocal sent
        sent = np.sum([(0,) * 6, *(m.move.steps for m in bench.moves())], axis=0)
        assert bench.arm.read().registers == tuple(sent)
        assert bench.memory.steps() == tuple(np.array(began) + sent)
        if not asked and isinstance(effect, do.Move) and len(bench.moves()) == moves:
            asked.append(how())
            return asked[0]
        return None

    asked: list[Exception] = []
    bench.interrupt = interrupt
    outcome = bench.run("massage")
    assert outcome == ("stopped" if asked and how is do.StopRequested else "done")
    moves = -1  # nobody breaks off the way home
    assert bench.run("home") == "done"
    assert bench.world.testimony()["breaches"] == []
    assert {t["surface"] for t in bench.touches()} <= {"leg"}
    assert all(-3.0 <= t["along_mm"] <= 197.0 for t in bench.touches())


@pytest.mark.parametrize("x", np.linspace(123.5, 127.0, 8))
def test_what_verify_accepts_at_the_edge_of_reach_is_not_refused_in_the_middle(x: float) -> None:
    """The elbow's limit runs along this row of legs: each is refused at once or massaged whole.

    Half-steps make the way a little other than the one rehearsed; verify leaves room for that, so
    that no command's end lies past a joint's limit, by however little.
    """
    yaw, rise, roll = np.radians([112.14, 7.738, -4.399])
    turns = [[0.0, 0.0, yaw], [0.0, -rise, 0.0], [roll, 0.0, 0.0]]
    about_z, about_y, about_x = (rotation_from_vector(t) for t in turns)
    bench = make_bench(1, massage=MassageSettings(strokes=1))
    bench.world.place_leg(transform(about_z @ about_y @ about_x, [x, -36.053, 50.556]))
    bench.memory.calibration = calibration_of(bench.settings, bench.world.world_from_object)
    if dry_run(bench.memory.calibration, bench.settings):
        return
    assert bench.run("massage") == "done"
    joints, _ = joints_from_steps(bench.settings.arm, [m.target for m in bench.moves()])
    assert not [found for j in joints for found in broken_limits(bench.settings.arm, j)]
