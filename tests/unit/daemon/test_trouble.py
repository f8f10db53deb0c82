"""Trouble of the devices: the camera is asked again for a while, the arm never; and evidence."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from legato.control.effects import Enter, Grab
from legato.control.memory import Memory
from legato.control.states import CAPTURE, DEADLINES, deadline
from legato.daemon.messages import Happened
from legato.daemon.patience import LIMIT_S, Patience
from legato.daemon.trail import KEPT, Trail
from legato.hal.camera import Frame
from legato.hal.faults import Cause, DeviceError
from tests.unit.daemon.bench import ZERO, Bench, Camera, Work, home_steps, turn
from tests.unit.daemon.house import House

LOST = DeviceError(Cause.CAMERA_LOST, "no picture", "plug it in")
STALE = DeviceError(Cause.CAMERA_STALE, "an old picture", "wait")


@dataclass
class Flaky(Camera):
    """A camera whose next grabs raise what is in the list; `opened` counts."""

    troubles: tuple[DeviceError, ...] = ()
    opened: int = 0

    def open(self) -> None:
        """Connect."""
        self.opened += 1
        super().open()

    def grab(self) -> Frame:
        """Return a picture, or raise the next trouble."""
        if self.troubles:
            error, *rest = self.troubles
            self.troubles = tuple(rest)
            raise error
        return super().grab()


@pytest.fixture
def camera() -> Flaky:
    """Give a camera that can be flaky."""
    return Flaky()


@pytest.fixture
def bench(tmp_path: Path, camera: Flaky) -> Iterator[Bench]:
    """Give a worker on fakes whose arm stands at home, and see that its thread ends."""
    made = Bench(tmp_path, camera=camera, last=(home_steps(), ZERO))
    yield made
    if made.worker is not None:
        assert made.quit()


def picture(_: Memory) -> Work:
    """Take one picture."""
    yield Enter("capture")
    yield Grab("capture")
    return "done"


def retries(bench: Bench) -> list[dict[str, object]]:
    """Return what was told of tries that failed."""
    told = [m.data for m in bench.heard if isinstance(m, Happened) and m.kind == "progress"]
    return [data["retry"] for data in told]


def test_a_camera_that_fails_for_a_moment_is_asked_again(bench: Bench, camera: Flaky) -> None:
    """Each try that failed is an event, the camera is opened anew, the pauses double."""
    bench.start()
    camera.troubles = (LOST, STALE, LOST)
    assert bench.run(picture).outcome == "done"
    told = retries(bench)
    assert [t["cause"] for t in told] == ["camera_lost", "camera_stale", "camera_lost"]
    assert [t["pause_s"] for t in told] == [0.25, 0.5, 1.0]
    assert [t["try"] for t in told] == [2, 3, 4]
    assert camera.opened == 1 + 3
    assert bench.clock.now == pytest.approx(1.75)
    assert bench.writer is not None
    assert (bench.writer.path / "frames" / "capture.png").exists()


def test_a_camera_that_stays_away_is_a_fault_inside_the_deadline(
    bench: Bench, camera: Flaky
) -> None:
    """The tries end well before the state must, and the fault tells what was done."""
    bench.start()
    camera.troubles = (LOST,) * 100
    end = bench.run(picture)
    assert end.fault is not None
    assert (end.outcome, end.fault.cause) == ("fault", Cause.CAMERA_LOST)
    assert bench.clock.now <= LIMIT_S < DEADLINES[CAPTURE]
    assert len(retries(bench)) >= 4
    assert end.fault.evidence["last_effects"] == ["Enter(state='capture')", "Grab(name='capture')"]
    assert end.fault.evidence["picture"] is None
    assert not end.view.camera_connected


def test_a_camera_that_is_opened_anew_and_is_not_there_is_asked_again(
    bench: Bench, camera: Flaky
) -> None:
    """Opening may fail as grabbing may."""
    bench.start()
    camera.troubles = (LOST,)
    camera.missing = LOST

    def back() -> None:
        if bench.clock.now > 1.0:
            camera.missing = None

    bench.clock.on_sleep = back
    assert bench.run(picture).outcome == "done"
    assert len(retries(bench)) == 3


def test_a_stop_comes_between_two_tries(bench: Bench, camera: Flaky) -> None:
    """Nobody waits for a camera before a stop is heeded."""
    bench.start()
    camera.troubles = (LOST,) * 100
    bench.clock.on_sleep = bench.orders.stop
    assert bench.run(picture).outcome == "stopped"
    assert len(retries(bench)) == 1


def test_other_trouble_is_not_asked_again() -> None:
    """Only what may pass by itself; and by either clock the time is up."""
    refused = DeviceError(Cause.CALIBRATION_REJECTED, "no", "")
    with pytest.raises(DeviceError):
        Patience(0.0, 0.0).pause(refused, 0.0, 0.0)
    assert Patience(0.0, 0.0).pause(LOST, 0.0, 0.0) == 0.25
    for late in ((LIMIT_S, 0.0), (0.0, LIMIT_S)):
        with pytest.raises(DeviceError):
            Patience(0.0, 0.0).pause(LOST, *late)


@pytest.mark.parametrize(
    "cause",
    [Cause.ARM_LOST, Cause.ARM_TIMEOUT, Cause.ARM_REFUSED, Cause.ARM_STOPPED_BY_PENDANT],
)
def test_a_motion_that_failed_is_never_tried_again(bench: Bench, cause: Cause) -> None:
    """One command was sent, none after it; the fault has the line's last bytes."""

    def work(memory: Memory) -> Work:
        yield Enter("move_home")
        steps = memory.steps()
        assert steps is not None
        yield turn(steps)
        raise AssertionError("the motion has failed")

    def fail() -> None:
        raise DeviceError(cause, "no", "look")

    bench.start()
    bench.arm.on_step = fail
    end = bench.run(work)
    assert end.fault is not None
    assert end.fault.cause is cause
    assert len(bench.arm.moves) == 1
    assert end.fault.evidence["last_bytes"] == ["@READ", "ok"]
    assert end.fault.evidence["last_effects"][-1].startswith("Move(")


def test_the_trail_is_short_and_begins_anew() -> None:
    """The last effects are kept; those of the job before are forgotten with its picture."""
    trail = Trail()
    for number in range(20):
        trail.add(str(number))
    trail.note(picture="frames/a.png", rms_px=0.2)
    told = trail.evidence()
    assert told["last_effects"] == [str(n) for n in range(20 - KEPT, 20)]
    assert (told["picture"], told["rms_px"], told["last_bytes"]) == ("frames/a.png", 0.2, [])
    trail.begin(None)
    assert trail.evidence() == {"last_effects": [], "picture": None, "last_bytes": []}


def test_a_line_that_changes_while_it_is_read_is_read_again() -> None:
    """The worker goes on while the loop asks for evidence."""

    class Line:
        asked = 0

        @property
        def last_bytes(self) -> tuple[str, ...]:
            self.asked += 1
            if 1 < self.asked < 4:
                raise RuntimeError("deque mutated during iteration")
            return ("@STEP",)

    trail = Trail()
    trail.begin(Line())
    assert trail.evidence()["last_bytes"] == ["@STEP"]


def test_a_deadline_tells_what_the_blocked_job_was_doing(tmp_path: Path) -> None:
    """The loop does not wait for the worker to know it."""
    house = House(tmp_path).known()
    session = house.begin("home")
    house.orders.trail.add("Move(x)")
    house.pass_time((deadline("move_home") or 0.0) + 1.0)
    house.end(session, None)
    house.pass_time(60.0)
    faults = house.of("fault")
    assert faults[0]["cause"] == "deadline"
    assert faults[0]["evidence"]["last_effects"] == ["Move(x)"]
    house.close()
