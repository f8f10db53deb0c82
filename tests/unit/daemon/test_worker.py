"""The worker: each task ends in one message, each motion is checked, a drop sends nothing more."""

import csv
import json

import pytest

from legato.control.effects import (
    CellFault,
    Dwell,
    Enter,
    Grab,
    Hold,
    PauseRequested,
    ReadArm,
    Record,
    Save,
    StopRequested,
)
from legato.control.memory import Memory
from legato.daemon.messages import Happened, Looked, Moved, StateWanted
from tests.unit.daemon.bench import Bench, Work, World, home_steps, settings, turn
from tests.unit.daemon.working import GONE, after


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
