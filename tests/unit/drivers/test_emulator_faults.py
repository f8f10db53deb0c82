"""Faults of the emulator: each strikes when asked, as spelled, and is told."""

import pytest

from legato.drivers.emulator import Emulator, Faults, fault
from legato.drivers.emulator.controller import HangUp
from legato.drivers.sim.clock import ManualClock
from tests.unit.drivers.emulated import STEP, ZERO_READ, robot


@pytest.mark.parametrize(
    ("spelled", "reply", "moves"),
    [
        ("silence", b"", 1),
        ("0", b"0\r", 0),
        ("late:by=3", b"1\r", 1),
        ("lost-steps", b"1\r", 1),
    ],
)
def test_a_fault_strikes_the_first_motion_once(spelled: str, reply: bytes, moves: int) -> None:
    """Without a trigger it is the first STEP; READs before it and STEPs after it are well."""
    emulator, arm, _ = robot(spelled)
    assert emulator.respond(b"@READ\r") == ZERO_READ
    assert emulator.respond(STEP) == reply
    assert len(arm.moves) == moves
    assert emulator.respond(STEP) == b"1\r"
    assert len(emulator.faults.struck) == 1


def test_garbage_is_no_reply_and_the_pendant_breaks_a_motion_off() -> None:
    """Noise has the motion done all the same; 2 leaves it in the middle, and registers know."""
    emulator, arm, _ = robot("garbage", "2:after=1")
    noise = emulator.respond(STEP)
    assert noise.endswith(b"\r")
    assert min(noise[:-1]) >= 0x80
    assert arm.registers[5] == -100
    assert emulator.respond(STEP) == b"2\r"
    assert -200 < arm.registers[5] < -100


def test_a_late_reply_takes_its_time() -> None:
    """`by` is seconds of the line's clock."""
    emulator, _, clock = robot("late:by=3.5")
    emulator.respond(STEP)
    assert clock.monotonic() == pytest.approx(3.5)


def test_lost_steps_are_a_motors_and_only_of_an_arm_that_can() -> None:
    """`by` and `motor` say how many of which; an arm without slipping motors is refused."""
    emulator, arm, _ = robot("lost-steps:by=40,motor=3")
    emulator.respond(STEP)
    assert arm.slips == [(3, 40)]

    class Firm:
        simulated = True

    with pytest.raises(ValueError, match="cannot lose"):
        Emulator(Firm(), ManualClock(), faults=Faults([fault("lost-steps")]))  # type: ignore[arg-type]


def test_a_stuck_switch_stays_stuck() -> None:
    """From its moment on every READ says the same, whatever the arm feels."""
    emulator, arm, _ = robot("stuck-closed:on=read,after=1", "stuck-open:on=read,after=3")
    reads = [emulator.respond(b"@READ\r") for _ in range(3)]
    arm.contact = True
    reads += [emulator.respond(b"@READ\r") for _ in range(2)]
    assert [r.endswith(b",128\r") for r in reads] == [False, True, True, False, False]


def test_a_hang_up_comes_before_the_motion_that_goes_on() -> None:
    """The line is gone first; the arm moves on by itself."""
    emulator, arm, _ = robot("hang-up:by=2")
    talk = emulator.talk(STEP)
    assert next(talk) == HangUp(2.0)
    assert arm.moves == []
    list(talk)
    assert len(arm.moves) == 1


def test_faults_wait_for_a_count_a_moment_or_a_chance() -> None:
    """After N motions, at a time, or by a seeded chance that may strike again."""
    emulator, _, _ = robot("0:after=2")
    assert [emulator.respond(STEP) for _ in range(4)] == [b"1\r", b"1\r", b"0\r", b"1\r"]
    emulator, _, clock = robot("0:at=5,on=any")
    assert emulator.respond(b"@RESET\r") == b"1\r"
    clock.sleep(5.0)
    assert emulator.respond(b"@RESET\r@RESET\r") == b"0\r1\r"
    draws = []
    for seed in (1, 1, 2):
        emulator, _, _ = robot("0:p=0.3", seed=seed)
        draws.append(b"".join(emulator.respond(STEP) for _ in range(200)))
    assert draws[0] == draws[1] != draws[2]
    assert 30 <= draws[0].count(b"0") <= 90


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("smoke", "no fault"),
        ("silence:when=2", "keys are"),
        ("silence:after=x", "invalid literal"),
        ("silence:p=1.5", "p is 0 to 1"),
        ("lost-steps:motor=7", "motor is 1 to 6"),
        ("silence:after=1,p=0.5", "one of"),
        ("silence:on=tuesday", "keys are"),
    ],
)
def test_a_fault_spelled_wrongly_is_refused(text: str, says: str) -> None:
    """The error names what is wrong with it."""
    with pytest.raises(ValueError, match=says):
        fault(text)
