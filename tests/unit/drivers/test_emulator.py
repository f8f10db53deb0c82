"""The emulated controller: its bytes are the manual's, its time the line's."""

import os
import threading

import pytest

from legato.drivers.emulator import Emulator, Faults, PseudoTerminal, fault
from legato.drivers.sim.clock import ManualClock
from legato.geometry.motion import StepMove
from legato.hal.faults import Cause, DeviceError
from legato.wire.teachmover import Write, encode
from legato.wire.teachmover_program import MoveTo, words
from tests.unit.drivers.emulated import CHARACTER, STEP, ZERO_READ, RecordingArm, robot


def test_each_command_gets_its_reply() -> None:
    """STEP, READ, RESET and SET as on the wire, in any split; nonsense gets a 0."""
    emulator, arm, _ = robot()
    assert emulator.respond(b"@STEP 183,1,-2,3,") == b""
    assert emulator.respond(b"4,5,6\r@READ\r") == b"1\r1\r1,-2,3,4,5,6,0\r"
    assert arm.moves == [StepMove((1, -2, 3, 4, 5, 6), 183)]
    arm.contact = True
    assert emulator.respond(b"@READ\r@RESET\r@READ\r@SET\r") == (
        b"1\r1,-2,3,4,5,6,128\r1\r1\r0,0,0,0,0,0,128\r1\r"
    )
    assert emulator.respond(b"@STOP\r") == b"0\r"


@pytest.mark.parametrize(("active_low", "inputs"), [(False, b"0"), (True, b"4")])
def test_the_switchs_bit_and_polarity(active_low: bool, inputs: bytes) -> None:
    """An open switch shows as configured."""
    emulator = Emulator(RecordingArm(), ManualClock(), switch_mask=4, switch_active_low=active_low)
    assert emulator.respond(b"@READ\r") == b"1\r0,0,0,0,0,0," + inputs + b"\r"


def test_registers_wrap_at_16_bits() -> None:
    """Counts beyond 16 bits come out as the robot's own registers would."""
    emulator, arm, _ = robot()
    arm.registers = (32768, -32769, 0, 0, 0, 0)
    assert emulator.respond(b"@READ\r") == b"1\r-32768,32767,0,0,0,0,0\r"


def test_close_goes_on_until_the_switch_closes() -> None:
    """Motor 6 closes step by step, and stops for good at the end of its range."""
    emulator, arm, _ = robot()
    arm.shut_after = 7
    assert emulator.respond(b"@CLOSE\r") == b"1\r"
    assert len(arm.moves) == 7
    assert all(m.steps[:5] == (0, 0, 0, 0, 0) and m.steps[5] < 0 for m in arm.moves)
    emulator, arm, _ = robot()
    assert emulator.respond(b"@CLOSE 100\r") == b"1\r"
    assert sum(m.steps[5] for m in arm.moves) == -1200


def test_a_stopped_arm_says_2_and_a_dead_one_nothing() -> None:
    """The pendant's STOP has its own reply; an arm that is lost has none."""
    emulator, arm, _ = robot()
    arm.error = DeviceError(Cause.ARM_STOPPED_BY_PENDANT, "stop")
    assert emulator.respond(b"@STEP 1,0,0,0,0,0,0\r") == b"2\r"
    arm.error = DeviceError(Cause.ARM_LOST, "gone")
    assert emulator.respond(b"@STEP 1,0,0,0,0,0,0\r") == b""


def test_a_program_is_kept_dumped_and_run() -> None:
    """QWRITE replaces a record by its number, QDUMP gives them in order, RUN goes to each."""
    emulator, arm, _ = robot()
    far, near = MoveTo(2, (10, -300, 0, 0, 0, 5), 200), MoveTo(1, (1, 1, 1, 1, 1, 1), 100)
    assert emulator.respond(b"@QDUMP\r") == b"1\r"
    for step in (far, MoveTo(1, (9, 9, 9, 9, 9, 9), 9), near):
        assert emulator.respond(encode(Write(words(step)))) == b"1\r"
    dumped = emulator.respond(b"@QDUMP\r").split(b"\r")
    assert [line[:2] for line in dumped] == [b"1", b"1,", b"2,", b""]
    assert emulator.respond(b"@RUN\r") == b"1\r"
    assert [m.speed for m in arm.moves] == [100, 200]
    assert arm.registers == far.registers
    assert emulator.respond(b"@QWRITE 3,4,0,0,0,0,0,0\r@RUN\r") == b"1\r0\r"
    assert len(arm.moves) == 2


def test_another_sign_begins_commands() -> None:
    """After ARM only the new sign is understood."""
    emulator, _, _ = robot()
    assert emulator.respond(b"@ARM #\r@READ\r#READ\r") == b"1\r0\r" + ZERO_READ


def test_characters_take_their_time_on_the_line() -> None:
    """At 9600 baud, 6 characters in and 16 out take 22 x 1.04 ms, each going out when due."""
    clock = ManualClock()
    emulator = Emulator(RecordingArm(), clock, baud=9600)
    out, times = [], []
    for piece in emulator.talk(b"@READ\r"):
        out.append(piece)
        times.append(clock.monotonic())
    assert b"".join(p for p in out if isinstance(p, bytes)) == ZERO_READ
    assert times == pytest.approx([(6 + n) * CHARACTER for n in range(1, 17)])


def test_a_command_starts_when_its_own_cr_is_there() -> None:
    """Of two commands sent at once the first is answered while the second still comes in."""
    clock = ManualClock()
    emulator = Emulator(RecordingArm(), clock, baud=9600)
    replies = iter(emulator.talk(b"@RESET\r@RESET\r"))
    assert b"".join([next(replies), next(replies)]) == b"1\r"  # type: ignore[list-item]
    assert clock.monotonic() == pytest.approx(9 * CHARACTER)
    list(replies)
    assert clock.monotonic() == pytest.approx(16 * CHARACTER)


def test_delay_spreads_what_is_sent() -> None:
    """A gap of one character doubles the time of a reply."""
    clock = ManualClock()
    emulator = Emulator(RecordingArm(), clock, baud=9600)
    emulator.respond(b"@DELAY 1\r")
    began = clock.monotonic()
    emulator.respond(b"@RESET\r")
    assert clock.monotonic() - began == pytest.approx((7 + 2 * 2) * CHARACTER)


def test_the_account_tells_commands_time_and_faults() -> None:
    """What passed is counted: a test can hold the host to it."""
    clock = ManualClock()
    emulator = Emulator(RecordingArm(), clock, baud=9600, faults=Faults([fault("0:after=1")]))
    emulator.respond(STEP + b"@READ\r@RESET\r" + STEP + b"@X\r")
    account = emulator.account()
    assert account["commands"] == {"step": 2, "read": 1, "other": 1, "refused": 1}
    assert account["motion_s"] == pytest.approx(100 / (10152 / 155))
    characters = 2 * len(STEP) + 6 + 7 + 3 + 5 * 2 + len(b"10,0,0,0,0,-100,0\r")
    assert account["line_s"] == pytest.approx(characters * CHARACTER)
    assert "0:after=1" in str(account["faults"])


def test_a_pseudo_terminal_closes_whatever_happened() -> None:
    """Its path is a terminal while it is open, and closing twice is quiet."""
    with PseudoTerminal(robot()[0]) as line:
        fd = os.open(line.path, os.O_RDWR | os.O_NOCTTY)
        assert os.isatty(fd)
        os.close(fd)
        line.stop()
        line.serve()
    line.close()


def test_a_line_that_hung_up_comes_back_as_another() -> None:
    """The old path is dead, the new one is told and answers."""
    told: list[str] = []
    again = threading.Event()

    def opened(path: str) -> None:
        told.append(path)
        if len(told) == 2:
            again.set()

    with PseudoTerminal(robot("hang-up:by=0")[0], opened) as line:
        thread = threading.Thread(target=line.serve)
        thread.start()
        try:
            fd = os.open(told[0], os.O_RDWR | os.O_NOCTTY)
            os.write(fd, STEP)
            assert again.wait(10.0)
            os.close(fd)
            fd = os.open(told[1], os.O_RDWR | os.O_NOCTTY)
            os.write(fd, b"@RESET\r")
            assert os.read(fd, 2) == b"1\r"
            os.close(fd)
        finally:
            line.stop()
            thread.join()
