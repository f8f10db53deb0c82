"""How the worker's tasks end otherwise: in faults and refusals, by reset, with the daemon."""

import pytest

from legato.control.effects import (
    Grab,
    Move,
    ReadArm,
    Refused,
)
from legato.control.memory import Memory
from legato.daemon.messages import Moved, TaskEnded, WorkerGone
from legato.daemon.orders import DoReference, DoReset
from legato.daemon.worker import truth_since
from legato.geometry.motion import StepMove, ToolPose
from legato.hal.faults import Cause, DeviceError
from legato.records.errors import RecordError
from tests.unit.daemon.bench import ZERO, Bench, Work, settings, shifted, turn
from tests.unit.daemon.working import GONE, after, moving


def test_registers_that_differ_are_a_following_error(bench: Bench) -> None:
    """What the arm reads back is compared with what it was told; its position is in doubt."""
    bench.arm.off_by = 1
    bench.start()
    end = bench.run(moving(3))
    assert end.fault is not None
    assert end.fault.cause == Cause.FOLLOWING_ERROR
    assert end.fault.evidence["commanded"] == [20, 0, 0, 0, 0, 0]
    assert end.fault.evidence["read"] == [21, 0, 0, 0, 0, 0]
    assert len(bench.arm.moves) == 1
    assert not end.view.arm["referenced"]


def test_a_motion_outside_the_envelope_is_not_sent(bench: Bench) -> None:
    """The envelope is asked before every motion."""

    def work(memory: Memory) -> Work:
        start = after(memory)
        target = shifted(start, 3000)
        yield Move(StepMove((3000, 0, 0, 0, 0, 0), 200), start, target, turn(start).why)
        return "done"

    bench.start()
    end = bench.run(work)
    assert (end.outcome, end.cause) == ("fault", Cause.LIMIT)
    assert bench.arm.moves == []


def test_a_motion_from_elsewhere_is_not_sent(bench: Bench) -> None:
    """A procedure that is wrong about where the arm stands moves nothing."""

    def work(memory: Memory) -> Work:
        yield turn(shifted(after(memory), 5))
        return "done"

    bench.start()
    assert bench.run(work).cause == Cause.LIMIT
    assert bench.arm.moves == []


@pytest.mark.parametrize("doubt", [False, True])
def test_a_lost_arm_is_a_fault_with_its_last_bytes(bench: Bench, doubt: bool) -> None:
    """A driver's error ends the job; whether the position holds, the driver knows."""

    def fail() -> None:
        bench.arm.position_in_doubt = doubt
        raise GONE

    bench.arm.on_step = fail
    bench.start()
    end = bench.run(moving(2))
    assert end.fault is not None
    assert (end.outcome, end.fault.cause) == ("fault", Cause.ARM_LOST)
    assert end.fault.evidence["last_bytes"] == ["@READ", "ok"]
    assert len(bench.arm.moves) == 1
    assert not end.view.arm["connected"]
    assert end.view.arm["referenced"] is not doubt


def test_a_refusal_is_no_fault(bench: Bench) -> None:
    """Refused ends as refused, with each reason."""

    def work(_: Memory) -> Work:
        yield ReadArm()
        raise Refused(Cause.CALIBRATION_REJECTED, ("rms too large", "marks in a line"))

    bench.start()
    end = bench.run(work)
    assert (end.outcome, end.reason) == ("refused", "rms too large; marks in a line")
    assert end.fault is None


def test_a_bug_is_fault_internal_with_its_traceback(bench: Bench) -> None:
    """Whatever is raised, the job has an outcome and the worker lives on."""

    def work(_: Memory) -> Work:
        yield ReadArm()
        raise ZeroDivisionError("oops")

    bench.start()
    end = bench.run(work)
    assert end.fault is not None
    assert end.fault.cause == Cause.INTERNAL
    assert "ZeroDivisionError: oops" in end.fault.evidence["traceback"]
    assert end.fault.evidence["last_effects"] == ["ReadArm()"]
    assert bench.run(moving(1)).outcome == "done"


def test_a_disk_that_takes_nothing_is_fault_disk(bench: Bench) -> None:
    """A record that cannot be written ends the job; nothing moves on unrecorded."""

    def work(memory: Memory) -> Work:
        assert bench.writer is not None
        (bench.writer.path / "frames").write_text("in the way")
        yield Grab("capture")
        yield turn(after(memory))
        return "done"

    bench.start()
    end = bench.run(work)
    assert (end.outcome, end.cause) == ("fault", Cause.DISK)
    assert bench.arm.moves == []


def test_telemetry_is_not_faster_than_people_see(bench: Bench) -> None:
    """Many quick motions give few looks at the arm, and all of them rows."""
    bench.start()
    assert bench.run(moving(25)).outcome == "done"
    assert bench.writer is not None
    rows = (bench.writer.path / "trajectory.csv").read_text().splitlines()
    assert len(rows) == 26
    looks = [m for m in bench.heard if isinstance(m, Moved)]
    assert 1 <= len(looks) < 25


def test_referencing_zeroes_the_registers_at_the_pose(bench: Bench) -> None:
    """After reference the arm stands at the pose that the operator told."""
    bench.arm.registers = (9, 9, 9, 9, 9, 9)
    assert not bench.start().view.arm["referenced"]
    bench.orders.give(DoReference(4, ToolPose(200.0, 0.0, 100.0)))
    end = bench.until(TaskEnded)
    assert (end.token, end.problem) == (4, None)
    assert bench.arm.registers == ZERO
    assert end.view.arm["xyz_mm"] == pytest.approx([200.0, 0.0, 100.0], abs=0.5)


def test_referencing_that_fails_leaves_the_arm_in_doubt(bench: Bench) -> None:
    """An arm lost while its registers are zeroed is not referenced any more."""
    bench.start()
    bench.arm.missing = GONE
    bench.orders.give(DoReference(1, settings().home))
    end = bench.until(TaskEnded)
    assert end.problem == ("no answer", "plug it in")
    assert not end.view.arm["referenced"]


def test_reset_opens_what_was_lost(bench: Bench) -> None:
    """Reset succeeds once arm and camera answer, and moves nothing."""
    bench.start()
    bench.arm.missing = GONE
    bench.orders.give(DoReset(1))
    assert bench.until(TaskEnded).problem == ("no answer", "plug it in")
    bench.arm.missing = None
    bench.orders.give(DoReset(2))
    end = bench.until(TaskEnded)
    assert (end.token, end.problem) == (2, None)
    assert end.view.arm["connected"]
    assert bench.arm.moves == []


def test_reset_asks_a_camera_that_counts_as_there(bench: Bench) -> None:
    """One that has died since its last picture is found by reset, and by no later job."""
    assert bench.start().view.camera_connected
    bench.camera.missing = DeviceError(Cause.CAMERA_LOST, "no picture", "see its cable")
    bench.orders.give(DoReset(1))
    end = bench.until(TaskEnded)
    assert end.problem == ("no picture", "see its cable")
    assert not end.view.camera_connected
    bench.camera.missing = None
    bench.orders.give(DoReset(2))
    assert bench.until(TaskEnded).view.camera_connected


def test_the_end_closes_both_devices(bench: Bench) -> None:
    """Quit lets go of arm and camera, and the loop is told."""
    bench.start()
    assert bench.quit()
    bench.worker = None
    assert bench.until(WorkerGone).text is None
    assert bench.arm.calls[-1] == "close"
    assert bench.camera.closed


def test_old_records_are_looked_at_before_the_devices_are_known(bench: Bench) -> None:
    """The clean-up has its first turn while no session can begin, one after a job; it may fail."""
    tidied: list[int] = []

    def tidy() -> None:
        tidied.append(len(bench.heard))
        raise RecordError("cannot remove", "look at the disk")

    bench.tidy = tidy
    bench.start()
    assert bench.run(moving(1)).outcome == "done"
    assert tidied[0] == 0
    assert len(tidied) == 2
    assert "not_tidied" in [event for event, _ in bench.log.lines]


def test_a_records_truth_is_of_its_own_session() -> None:
    """What the world saw in earlier sessions is left out; where things are stays."""
    testimony: dict[str, object] = {
        "touches": [{"began_s": 3.0}, {"began_s": 7.0}],
        "breaches": [{"t_s": 4.9}, {"t_s": 5.0}],
        "registers": [1, 2],
    }
    assert truth_since(testimony, 5.0) == {
        "touches": [{"began_s": 7.0}], "breaches": [{"t_s": 5.0}], "registers": [1, 2],
    }  # fmt: skip
    assert len(testimony["touches"]) == 2  # type: ignore[arg-type] # it stays whole
