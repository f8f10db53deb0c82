"""Faults on schedule: each strikes when it should, looks like a real one, and fits the world."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from legato.drivers.faulty.arm import FaultyArm, faulty_arm
from legato.drivers.faulty.camera import FaultyCamera
from legato.drivers.faulty.script import Script
from legato.drivers.faulty.settings import FaultSettings
from legato.drivers.sim.arm import SimArm
from legato.drivers.sim.clock import ManualClock
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import World
from legato.geometry.arm import ArmModel
from legato.geometry.leg import Leg
from legato.geometry.motion import StepMove
from legato.hal.arm import Arm, Traced, Witness
from legato.hal.camera import Frame
from legato.hal.faults import Cause, DeviceError

MOVE = StepMove((40, 20, 0, 0, 0, 0), 150)
ZERO = (0, 0, 0, 0, 0, 0)


@dataclass
class Bench:
    """A faulty arm over a simulated one, both open."""

    arm: FaultyArm
    world: World
    clock: ManualClock


def bench(*faults: FaultSettings) -> Bench:
    """Return an open arm with faults."""
    clock = ManualClock()
    true = SimSettings(scatter_mm=0.0, scatter_deg=0.0, backlash_steps=0.0)
    world = World(true, Leg(), ArmModel(), clock)
    arm = faulty_arm(SimArm(world), faults, clock)
    arm.open()
    return Bench(arm, world, clock)


def fault(kind: Any, **given: Any) -> FaultSettings:
    """Return a fault that begins at the first call where nothing else is said."""
    if not {"at_s", "call", "p"} & given.keys():
        given["call"] = 1
    return FaultSettings(kind=kind, **given)


def cause_of(call: Callable[[], object]) -> Cause:
    """Return the cause that a call raises."""
    with pytest.raises(DeviceError) as caught:
        call()
    assert caught.value.hint
    return caught.value.cause


def strikes(made: int = 20, **given: Any) -> list[int]:
    """Return the numbers of the steps, one a cell second, that a fault strikes."""
    clock = ManualClock()
    script = Script([fault("arm_refused", **given)], clock)
    found = []
    for number in range(1, made + 1):
        if script.struck_by("step"):
            found.append(number)
        script.struck_by("read")
        clock.sleep(1.0)
    return found


def test_a_fault_begins_by_number_by_time_or_by_lot() -> None:
    """Only the calls that count are counted; each fault by number or time begins once."""
    assert strikes(call=3) == [3]
    assert strikes(call=3, calls=2) == [3, 4]
    assert strikes(call=5, on="any") == [3]
    assert strikes(at_s=6.5) == [8]
    assert strikes(call=3, for_s=3.5) == [3, 4, 5, 6]
    assert strikes(p=0.0) == []
    assert strikes(p=1.0) == list(range(1, 21))


@given(seed=st.integers(0, 2**32), p=st.floats(0.05, 0.95))
def test_the_lot_is_the_seeds(seed: int, p: float) -> None:
    """The same seed strikes the same calls, about as many as the probability says."""
    first = strikes(200, p=p, seed=seed)
    assert first == strikes(200, p=p, seed=seed)
    assert abs(len(first) - 200 * p) < 6.0 * np.sqrt(200 * p * (1 - p)) + 1


def test_a_line_that_is_lost_stays_lost_until_it_can_be_opened() -> None:
    """The motion is not begun, every later call is arm_lost, and it stays shut a while."""
    made = bench(fault("arm_lost", call=2, for_s=10.0))
    made.arm.step(MOVE)
    assert cause_of(lambda: made.arm.step(MOVE)) is Cause.ARM_LOST
    assert made.world.registers == MOVE.steps
    assert made.arm.position_in_doubt
    assert [cause_of(made.arm.read), cause_of(made.arm.open)] == [Cause.ARM_LOST] * 2
    made.clock.sleep(10.0)
    assert cause_of(made.arm.read) is Cause.ARM_LOST
    made.arm.open()
    assert made.arm.read().registers == MOVE.steps
    assert made.arm.position_in_doubt
    made.arm.zero()
    assert not made.arm.position_in_doubt


@pytest.mark.parametrize(
    ("kind", "done", "doubt", "lasts_s"),
    [
        ("arm_timeout", (40, 20), True, 1.0),
        ("arm_refused", (0, 0), False, 0.0),
        ("arm_stopped_by_pendant", (20, 10), True, 0.0),
    ],
)
def test_a_motion_ends_as_its_fault_says(
    kind: str, done: tuple[int, int], doubt: bool, lasts_s: float
) -> None:
    """Cause, doubt and what the arm has truly done fit together; then the line is of use again."""
    made, within = bench(fault(kind)), bench()
    if any(done):
        within.arm.step(StepMove((*done, 0, 0, 0, 0), MOVE.speed))
    assert cause_of(lambda: made.arm.step(MOVE)) is Cause(kind)
    assert made.clock.monotonic() == pytest.approx(within.clock.monotonic() + lasts_s)
    assert made.world.registers[:2] == done
    assert made.arm.position_in_doubt is doubt
    made.arm.step(MOVE)
    assert made.world.registers[:2] == (done[0] + 40, done[1] + 20)


def test_a_call_that_blocks_ends_late_and_well() -> None:
    """The reading is right, so many cell seconds later."""
    made = bench(fault("arm_blocks", on="read", by=7.0))
    before = made.clock.monotonic()
    assert made.arm.read().registers == ZERO
    assert made.clock.monotonic() - before == 7.0


def test_missed_steps_show_in_the_registers_or_do_not() -> None:
    """A following error is read back, lost steps are not; the true arm has missed both."""
    told = bench(fault("following_error", motor=1, by=30))
    hidden = bench(fault("lost_steps", motor=1, by=30))
    assert told.arm.step(MOVE).registers == (10, 20, 0, 0, 0, 0)
    assert hidden.arm.step(MOVE).registers == MOVE.steps
    assert hidden.arm.read().registers == MOVE.steps
    assert told.world.registers == hidden.world.registers == (10, 20, 0, 0, 0, 0)
    hidden.arm.zero()
    assert hidden.arm.read().registers == ZERO


def test_the_other_motors_turn_no_faster_where_one_misses_steps() -> None:
    """A command that is shortened lasts as long as it would have: the world sees no odd rates."""
    move = StepMove((200, 20, 180, 0, 0, 0), 230)
    made, whole = bench(fault("lost_steps", motor=1, by=150)), bench()
    made.arm.step(move)
    whole.arm.step(move)
    assert made.world.testimony()["breaches"] == []
    assert made.clock.monotonic() == pytest.approx(whole.clock.monotonic(), rel=0.1)


def test_a_motor_misses_steps_only_of_what_it_is_sent() -> None:
    """What one command does not have to offer, the next ones miss, whichever way they go."""
    made = bench(fault("lost_steps", motor=1, by=60))
    made.arm.step(MOVE)
    made.arm.step(StepMove((-40, 0, 0, 0, 0, 0), 150))
    assert made.world.registers[0] == -20
    assert made.arm.read().registers[0] == 0


def test_the_switch_sticks_for_good_for_a_while_or_reads_wrong_once() -> None:
    """Closed, open and early contact are seen in every reading that they hold for."""
    closed = bench(fault("stuck_closed"))
    assert not closed.arm.read().contact
    assert closed.arm.step(MOVE).contact
    assert closed.arm.read().contact
    awhile = bench(fault("stuck_closed", for_s=5.0))
    assert awhile.arm.step(MOVE).contact
    awhile.clock.sleep(5.0)
    assert not awhile.arm.read().contact
    early = bench(fault("early_contact", call=2))
    assert [early.arm.step(MOVE).contact for _ in range(3)] == [False, True, False]


def test_a_wrapped_arm_is_what_the_arm_within_is() -> None:
    """Witness where a world can tell, traced where there is a line."""

    @dataclass
    class Line:
        simulated: bool = False
        position_in_doubt: bool = False
        last_bytes: tuple[str, ...] = ("@READ",)
        calls: list[str] = field(default_factory=list)

        def open(self) -> None: ...
        def close(self) -> None: ...
        def read(self) -> Any: ...
        def step(self, move: StepMove) -> Any: ...
        def zero(self) -> None: ...

    line = faulty_arm(Line(), [fault("arm_refused", on="read")], ManualClock())
    assert isinstance(line, Arm)
    assert isinstance(line, Traced)
    assert not isinstance(line, Witness)
    assert line.last_bytes == ("@READ",)
    sim = bench().arm
    assert isinstance(sim, Witness)
    assert not isinstance(sim, Traced)


class Camera:
    """A camera of striped pictures."""

    simulated = True

    def __init__(self) -> None:
        self.is_open = False
        self.taken = 0

    def open(self) -> None:
        """Connect."""
        self.is_open = True

    def close(self) -> None:
        """Let go."""
        self.is_open = False

    def grab(self) -> Frame:
        """Return a picture."""
        if not self.is_open:
            raise DeviceError(Cause.CAMERA_LOST, "not open", "open it")
        self.taken += 1
        image = np.tile(np.array([20, 250], np.uint8), (6, 4))
        return Frame(image, 0.1, self.taken, "striped")


def camera(*faults: FaultSettings) -> tuple[FaultyCamera, ManualClock]:
    """Return an open camera with faults."""
    clock = ManualClock()
    made = FaultyCamera(Camera(), faults, clock)
    made.open()
    return made, clock


def test_a_lost_camera_is_found_again_when_it_is_back() -> None:
    """Grabbing and opening fail while it is away; then it must be opened anew."""
    made, clock = camera(fault("camera_lost", call=2, for_s=8.0))
    made.grab()
    assert cause_of(made.grab) is Cause.CAMERA_LOST
    assert cause_of(made.open) is Cause.CAMERA_LOST
    clock.sleep(8.0)
    assert cause_of(made.grab) is Cause.CAMERA_LOST
    made.open()
    assert made.grab().sequence == 2


def test_a_stale_camera_can_be_opened_and_has_no_new_picture() -> None:
    """Each grab is camera_stale while it lasts, and tells how old the picture is."""
    made, clock = camera(fault("camera_stale", for_s=3.0, by=9.0))
    with pytest.raises(DeviceError, match="9 s old"):
        made.grab()
    made.open()
    assert cause_of(made.grab) is Cause.CAMERA_STALE
    clock.sleep(3.0)
    assert made.grab().image.std() > 50


def test_blank_dark_and_slow_pictures() -> None:
    """A blank picture has one grey, a dark one next to no light, a slow one takes its time."""
    made, clock = camera(fault("blank"), fault("dark", call=2), fault("slow_grab", call=3, by=4.0))
    assert (made.grab().image == 128).all()
    assert 0 < made.grab().image.max() <= 5
    before = clock.monotonic()
    assert made.grab().image.max() == 250
    assert clock.monotonic() - before == 4.0
