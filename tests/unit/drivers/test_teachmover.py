"""The TeachMover's driver on a scripted line: typed errors, no hanging, no reply taken wrongly."""

import termios

import pytest

from legato.drivers.sim.clock import ManualClock
from legato.drivers.teachmover import Port, TeachMover, TeachMoverSettings
from legato.geometry.motion import StepMove
from legato.hal.arm import Arm, Traced
from legato.hal.faults import Cause, DeviceError
from tests.unit.drivers.scripted import ANSWER, MOVE, ScriptedPort, cause_of, opened


def test_a_step_is_a_step_and_a_read() -> None:
    """The command's bytes, then @READ; the reading is what that says."""
    arm, port, _ = opened(b"1\r", b"1\r11,-2,3,4,5,6,128\r")
    reading = arm.step(MOVE)
    assert port.written == [b"@STEP 183,10,0,0,0,0,0\r", b"@READ\r"]
    assert reading.registers == (11, -2, 3, 4, 5, 6)
    assert reading.contact
    assert reading.inputs == 128
    assert not arm.position_in_doubt


def test_replies_that_come_in_single_bytes_are_the_same() -> None:
    """How the kernel cuts the line does not matter."""
    arm, port, _ = opened(b"1\r", b"1\r11,2,3,4,5,6,0\r")
    port.cut = 1
    assert arm.step(MOVE).registers == (11, 2, 3, 4, 5, 6)


@pytest.mark.parametrize(
    ("mask", "active_low", "inputs", "contact"),
    [(0x80, False, 0x80, True), (0x80, False, 0x7F, False), (0x01, False, 0x301, True),
     (0x01, True, 0x01, False), (0x01, True, 0x00, True), (0x80, False, 0x8000, False)],
)  # fmt: skip
def test_mask_and_polarity_of_the_switch_are_settings(
    mask: int, active_low: bool, inputs: int, contact: bool
) -> None:
    """Which input bit is the grip switch, and whether it closes to 0 or 1; keys do not matter."""
    reply = f"1\r0,0,0,0,0,0,{inputs}\r".encode()
    arm, _, _ = opened(reply, switch_mask=mask, active_low=active_low)
    assert arm.read().contact is contact


def test_silence_ends_after_the_motion_and_a_margin() -> None:
    """A lost reply is arm_timeout, no sooner than the motion can end and soon after it."""
    arm, port, clock = opened()
    move = StepMove((1410, 0, 0, 0, 0, 0), 183)
    began = clock.monotonic()
    assert cause_of(lambda: arm.step(move)) is Cause.ARM_TIMEOUT
    waited = clock.monotonic() - began
    assert move.duration + 1.0 <= waited <= move.duration + 1.3
    assert arm.position_in_doubt
    assert len(port.written) == 1


def test_a_process_that_was_frozen_finds_the_reply_waiting() -> None:
    """A reply that lies in the port when the time is up came in time: nothing is in doubt."""
    clock = ManualClock()

    class Frozen(ScriptedPort):
        def read(self, size: int = 1) -> bytes:
            if self.written[-1].startswith(b"@STEP") and clock.monotonic() < 20.0:
                clock.sleep(20.0)  # stopped while it waited; the reply came meanwhile
                self.incoming += b"1\r"
                return b""
            return super().read(size)

    arm = TeachMover(
        TeachMoverSettings(port="/dev/arm"), clock, lambda _: Frozen(clock, [ANSWER, b"", ANSWER])
    )
    arm.open()
    assert arm.step(MOVE).registers == (1, 2, 3, 4, 5, 6)
    assert not arm.position_in_doubt


def test_a_late_reply_is_never_taken_for_the_next_commands() -> None:
    """After a time-out the line is settled by a read: the late 1 does not end the next motion."""
    arm, port, _ = opened()
    assert cause_of(lambda: arm.step(MOVE)) is Cause.ARM_TIMEOUT
    port.replies = [b"1\r" + ANSWER, b"", ANSWER]
    assert cause_of(lambda: arm.step(MOVE)) is Cause.ARM_TIMEOUT
    assert port.written[1:] == [b"@READ\r", b"@STEP 183,10,0,0,0,0,0\r"]


def test_bytes_that_came_between_commands_are_thrown_away() -> None:
    """Noise on an idle line does no harm."""
    arm, port, _ = opened(ANSWER)
    port.incoming += b"2\rgarbage"
    assert arm.read().registers == (1, 2, 3, 4, 5, 6)


def test_stop_on_the_pendant_leaves_the_position_in_doubt_until_zeroed() -> None:
    """Reading again does not clear the doubt; zeroing does."""
    arm, port, _ = opened(b"2\r")
    assert cause_of(lambda: arm.step(MOVE)) is Cause.ARM_STOPPED_BY_PENDANT
    assert arm.position_in_doubt
    port.replies = [ANSWER, ANSWER, b"1\r", ANSWER, b"1\r"]
    arm.read()
    arm.step(MOVE)
    assert arm.position_in_doubt
    arm.zero()
    assert not arm.position_in_doubt
    assert port.written[-1] == b"@RESET\r"


def test_a_refused_command_moves_nothing() -> None:
    """0 is arm_refused, without doubt about the position."""
    arm, _, _ = opened(b"0\r")
    assert cause_of(lambda: arm.step(MOVE)) is Cause.ARM_REFUSED
    assert not arm.position_in_doubt


def test_a_command_that_cannot_be_sent_leaves_no_doubt() -> None:
    """Steps beyond 16 bits are our error, and nothing reaches the line."""
    arm, port, _ = opened()
    with pytest.raises(ValueError, match="J1"):
        arm.step(StepMove((40000, 0, 0, 0, 0, 0), 183))
    assert not arm.position_in_doubt
    assert port.written == []


@pytest.mark.parametrize("error", [OSError(5, "gone"), termios.error(5, "gone")])
def test_a_vanished_adapter_is_lost_until_opened_again(error: Exception) -> None:
    """Errors of either kind are arm_lost; later calls say so at once; open tries the port again."""
    arm, port, clock = opened(b"")
    port.broken = error
    assert cause_of(arm.read) is Cause.ARM_LOST
    assert cause_of(arm.read) is Cause.ARM_LOST
    assert not arm.position_in_doubt
    arm.close()
    port.broken = None
    port.replies = [ANSWER, ANSWER]
    began = clock.monotonic()
    arm.open()
    assert arm.read().registers == (1, 2, 3, 4, 5, 6)
    assert clock.monotonic() - began < 1.0


def test_an_adapter_that_vanishes_in_a_motion_leaves_doubt() -> None:
    """The write itself may have reached the arm."""
    arm, _, _ = opened(OSError(5, "gone"))
    assert cause_of(lambda: arm.step(MOVE)) is Cause.ARM_LOST
    assert arm.position_in_doubt


def test_garbage_is_lost_with_the_bytes_as_evidence() -> None:
    """A wrong baud rate shows as bytes that no TeachMover sends; they are kept."""
    arm, _, _ = opened(b"\xfe\x80\r")
    assert cause_of(arm.read) is Cause.ARM_LOST
    assert any("< b'\\xfe\\x80\\r'" in chunk for chunk in arm.last_bytes)
    assert any("> b'@READ\\r'" in chunk for chunk in arm.last_bytes)
    assert len(arm.last_bytes) <= 40


def test_open_settles_a_line_with_old_business() -> None:
    """Replies to a dead daemon's commands are passed over when the port is opened."""
    clock = ManualClock()
    port = ScriptedPort(clock, [b"0\r", b"1\r" + ANSWER, ANSWER])
    arm = TeachMover(TeachMoverSettings(port="/dev/arm"), clock, lambda _: port)
    arm.open()
    assert arm.read().registers == (1, 2, 3, 4, 5, 6)


def test_open_fails_where_nothing_answers() -> None:
    """A silent line is arm_timeout, a missing port arm_lost with the port's name."""
    clock = ManualClock()
    port = ScriptedPort(clock, [])
    settings = TeachMoverSettings(port="/dev/arm")
    silent = TeachMover(settings, clock, lambda _: port)
    assert cause_of(silent.open) is Cause.ARM_TIMEOUT
    assert port.closed
    assert cause_of(silent.read) is Cause.ARM_LOST

    def missing(_: TeachMoverSettings) -> Port:
        raise FileNotFoundError("no such device")

    with pytest.raises(DeviceError, match="/dev/arm"):
        TeachMover(settings, clock, missing).open()


def test_a_real_port_that_is_not_there_says_so() -> None:
    """The error of pyserial itself comes out typed."""
    arm = TeachMover(TeachMoverSettings(port="/dev/legato-no-such-port"), ManualClock())
    assert cause_of(arm.open) is Cause.ARM_LOST


def test_close_is_quiet_in_any_state() -> None:
    """Closing a closed, an open and a vanished port raises nothing."""
    arm, port, _ = opened()
    arm.close()
    arm.close()
    arm, port, _ = opened()
    port.broken = OSError(5, "gone")
    arm.close()
    assert port.closed


def test_a_slow_lines_late_bytes_are_waited_out() -> None:
    """At 110 baud characters come further apart than a look lasts: the line is not yet quiet."""
    clock = ManualClock()
    port = ScriptedPort(clock, [ANSWER, ANSWER])
    port.dripping = [b"", b"1", b"", b"\r", b""]
    TeachMover(TeachMoverSettings(port="/dev/arm", baud=110), clock, lambda _: port).open()
    assert port.dripping == []


def test_a_line_that_babbles_does_not_hold_open_up() -> None:
    """Throwing away ends with the margin even where bytes never stop."""
    clock = ManualClock()
    port = ScriptedPort(clock, [ANSWER])
    port.dripping = [b"x"] * 1000
    TeachMover(TeachMoverSettings(port="/dev/arm"), clock, lambda _: port).open()
    assert clock.monotonic() < 1.2


def test_a_line_that_babbles_replies_is_timed_out() -> None:
    """A robot that says done for ever never gives registers: arm_timeout, as for silence."""
    arm, port, clock = opened()
    port.dripping = [b"1\r"] * 1000
    assert cause_of(arm.read) is Cause.ARM_TIMEOUT
    assert clock.monotonic() < 1.4


def test_it_remembers_its_bytes() -> None:
    """Whoever writes evidence finds them by the protocol, not by a name."""
    arm, _, _ = opened()
    assert isinstance(arm, Arm)
    assert isinstance(arm, Traced)
    assert len(arm.last_bytes) == 2
