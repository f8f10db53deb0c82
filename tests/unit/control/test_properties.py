"""What holds for every leg pose, whatever verify thinks of it."""

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from legato.control.rehearsal import dry_run
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
