"""The worker: each task ends in one message, each motion is checked, a drop sends nothing more."""

import csv
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from legato.control.effects import (
    CellFault,
    Dwell,
    Enter,
    Grab,
    Hold,
    Move,
    PauseRequested,
    ReadArm,
    Record,
    Refused,
    Save,
    StopRequested,
)
from legato.control.memory import Memory
from legato.daemon.messages import Happened, Looked, Moved, StateWanted, TaskEnded, WorkerGone
from legato.daemon.orders import DoReference, DoReset
from legato.daemon.worker import truth_since
from legato.geometry.motion import StepMove, Steps, ToolPose
from legato.hal.faults import Cause, DeviceError
from legato.records.errors import RecordError
from tests.unit.daemon.bench import ZERO, Bench, Work, World, home_steps, settings, shifted, turn

GONE = DeviceError(Cause.ARM_LOST, "no answer", "plug it in")


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """Give a worker on fakes whose arm stands at home, and see that its thread ends."""
    made = Bench(tmp_path, last=(home_steps(), ZERO))
    yield made
    if made.worker is not None:
        assert made.quit()


def after(memory: Memory) -> Steps:
    """Return where the arm stands."""
    steps = memory.steps()
    assert steps is not None
    return steps


def moving(count: int) -> Callable[[Memory], Work]:
    """Return a procedure of some motions."""

    def work(memory: Memory) -> Work:
        yield Enter("move_home")
        for _ in range(count):
            memory.registers = (yield turn(after(memory))).registers
        return "done"

    return work


def test_a_job_ends_done_with_its_record(bench: Bench) -> None:
    """Pictures, documents, trajectory and truth are in the record, events at the loop."""

    def work(memory: Memory) -> Work:
        yield Enter("capture")
        frame = yield Grab("capture")
        yield Save("notes", {"rows": frame.image.shape[0]})
        yield Record("contact", {"contact_mm": 0.5})
        memory.registers = (yield turn(after(memory))).registers
        return "done"

    bench.witness = World()
    bench.start()
    end = bench.run(work)
    assert (end.outcome, end.reason, end.fault) == ("done", None, None)
    assert bench.writer is not None
    path = bench.writer.path
    assert json.loads((path / "notes.json").read_text()) == {"rows": 8}
    assert json.loads((path / "truth.json").read_text()) == {"touches": []}
    assert (path / "frames" / "capture.png").read_bytes().startswith(b"\x89PNG")
    (row,) = csv.DictReader((path / "trajectory.csv").read_text().splitlines())
    assert [int(row["commanded_1"]), int(row["read_1"])] == [home_steps()[0] + 20] * 2
    assert row["why"] == "transit"
    session = bench.writer.id
    assert StateWanted(session, "capture") in bench.heard
    assert Happened(session, "contact", {"contact_mm": 0.5}) in bench.heard


def test_the_view_tells_where_the_arm_stands(bench: Bench) -> None:
    """The pose in the view is that of reference and registers."""
    known = bench.start()
    assert known.view.arm["connected"]
    assert known.view.arm["referenced"]
    home = settings().home
    assert known.view.arm["xyz_mm"] == pytest.approx([home.x, home.y, home.z], abs=0.5)
    assert known.versions["legato"]


def test_an_arm_whose_registers_have_changed_is_not_referenced(bench: Bench) -> None:
    """Registers that are not those recorded last put the position in doubt."""
    bench.arm.registers = (1, 0, 0, 0, 0, 0)
    arm = bench.start().view.arm
    assert arm["connected"]
    assert not arm["referenced"]
    assert arm["xyz_mm"] is None


def test_a_simulated_arm_stands_where_the_configuration_puts_it(bench: Bench) -> None:
    """Switched on anew, it is referenced at once."""
    bench.last, bench.stands_at = (None, None), settings().home
    assert bench.start().view.arm["referenced"]


def test_missing_devices_are_shown_and_opened_later(bench: Bench) -> None:
    """A daemon without arm or camera lives, and finds them by itself."""
    bench.arm.missing = bench.camera.missing = GONE
    bench.look_s = 0.01
    known = bench.start()
    assert not known.view.arm["connected"]
    assert not known.view.camera_connected
    bench.arm.missing = bench.camera.missing = None
    looked = bench.until(Looked)
    while not (looked.view.arm["connected"] and looked.view.camera_connected):
        looked = bench.until(Looked)
    assert bench.arm.moves == []


def test_an_idle_arm_that_vanishes_is_seen(bench: Bench) -> None:
    """The idle worker looks at the arm; losing it is shown, not raised."""
    bench.look_s = 0.01
    assert bench.start().view.arm["connected"]
    bench.arm.missing = GONE
    while bench.until(Looked).view.arm["connected"]:
        pass


def test_a_stop_is_told_to_the_procedure_which_retracts(bench: Bench) -> None:
    """StopRequested comes before the next effect, and the retract's motions still go out."""

    def work(memory: Memory) -> Work:
        try:
            while True:
                memory.registers = (yield turn(after(memory), 1)).registers
                if len(bench.arm.moves) == 3:
                    bench.orders.stop()
        except StopRequested:
            yield Enter("stopping")
            yield turn(after(memory), -3)
            return "stopped"

    bench.start()
    assert bench.run(work).outcome == "stopped"
    assert [m.steps[0] for m in bench.arm.moves] == [1, 1, 1, -3]


def test_a_procedure_that_heeds_no_stop_ends_stopped(bench: Bench) -> None:
    """A stop that the procedure lets through is an outcome, not a bug."""

    def work(_: Memory) -> Work:
        bench.orders.stop()
        yield ReadArm()
        return "done"

    bench.start()
    assert bench.run(work).outcome == "stopped"


def test_pause_holds_until_resumed(bench: Bench) -> None:
    """PauseRequested leads to Hold, which ends when the operator resumes."""

    def work(_: Memory) -> Work:
        try:
            bench.orders.pause()
            yield ReadArm()
        except PauseRequested:
            yield Enter("paused")
            yield Hold()
        return "done"

    bench.start()
    writer = bench.begin(work)
    while bench.until(StateWanted) != StateWanted(writer.id, "paused"):
        pass
    bench.until(Moved)  # the look at the arm that precedes the hold
    bench.orders.resume()
    assert bench.run_end().outcome == "done"


def test_after_a_drop_nothing_more_is_sent(bench: Bench) -> None:
    """A dropped job sends no further motion, even where its clean-up asks for one."""

    def work(memory: Memory) -> Work:
        try:
            while True:
                memory.registers = (yield turn(after(memory), 1)).registers
        except (StopRequested, CellFault):
            yield turn(after(memory), -3)
        return "done"

    bench.start()
    bench.arm.on_step = lambda: bench.orders.drop() if len(bench.arm.moves) == 2 else None
    end = bench.run(work)
    assert end.outcome is None
    assert len(bench.arm.moves) == 2
    assert end.view.arm["referenced"]


def test_a_dwell_is_broken_off_by_a_stop(bench: Bench) -> None:
    """A stop does not wait for the end of a long dwell."""

    def work(_: Memory) -> Work:
        yield Dwell(3600.0)
        return "done"

    bench.clock.on_sleep = bench.orders.stop
    bench.start()
    assert bench.run(work).outcome == "stopped"
    assert bench.clock.now < 1.0


def test_a_dwell_lasts_as_long_as_it_says(bench: Bench) -> None:
    """The cell's time passes in full."""

    def work(_: Memory) -> Work:
        yield Dwell(1.25)
        return "done"

    bench.start()
    assert bench.run(work).outcome == "done"
    assert bench.clock.now == pytest.approx(1.25)


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
        (bench.writer.path / "frames").rmdir()
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
