"""The robot's controller: commands in, replies out, over whichever arm is handed in.

Commands come as bytes in any split; the reply goes out after the motion has ended, as on the real
arm, and each character takes its time on the line.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from legato.drivers.emulator.faults import Fault, Faults, Kind
from legato.drivers.emulator.uart import Uart
from legato.geometry.motion import StepMove, Steps
from legato.hal.arm import Arm
from legato.hal.clock import Clock
from legato.hal.faults import Cause, DeviceError
from legato.wire.teachmover import (
    Attention,
    Close,
    Command,
    Delay,
    Done,
    Dump,
    Dumped,
    Read,
    Refused,
    Registers,
    Reply,
    Reset,
    Run,
    Set,
    Step,
    StoppedByPendant,
    Write,
)
from legato.wire.teachmover_lines import CR, WireError
from legato.wire.teachmover_program import move_to
from legato.wire.teachmover_robot import CommandParser, encode_reply

GRIP_STEPS = 4  # half-steps of the gripper between two looks at its switch
GRIP_RANGE = 1200  # half-steps from wide open to shut
CLOSING_SPEED = 200
NOISE = 24  # bytes of garbage


@runtime_checkable
class Slips(Protocol):
    """An arm whose motors can be made to lose steps."""

    def slip(self, motor: int, steps: int) -> None:
        """Have a motor (1 to 6) miss its next half-steps."""


@dataclass(frozen=True)
class HangUp:
    """The line is gone, and back after so many seconds of the wall, or never."""

    back_s: float | None


class Emulator:
    """A TeachMover's controller; `arm`, which is open, does the moving.

    `baud` makes each character take its time on `clock`; without it the line is infinitely fast.
    Raises ValueError for a fault that the arm cannot have.
    """

    def __init__(
        self,
        arm: Arm,
        clock: Clock,
        *,
        switch_mask: int = 0x80,
        switch_active_low: bool = False,
        baud: int | None = None,
        faults: Faults | None = None,
    ) -> None:
        self.faults = faults if faults is not None else Faults()
        if Kind.LOST_STEPS in self.faults.kinds and not isinstance(arm, Slips):
            raise ValueError("this arm cannot lose steps on request")
        self._arm = arm
        self._clock = clock
        self._began = clock.monotonic()
        self._mask = switch_mask
        self._active_low = switch_active_low
        self._stuck: bool | None = None
        self._uart = Uart(clock, baud)
        self._parser = CommandParser()
        self._program: dict[int, tuple[int, ...]] = {}
        self._counts = {"step": 0, "read": 0, "other": 0, "refused": 0}
        self._motion_s = 0.0

    def respond(self, data: bytes) -> bytes:
        """Take in bytes, carry out the commands they complete, return the bytes of the replies."""
        return b"".join(out for out in self.talk(data) if isinstance(out, bytes))

    def talk(self, data: bytes) -> Iterator[bytes | HangUp]:
        """Take in bytes, and yield those of the replies as they go out on the line."""
        for piece in self._uart.receive(data):
            self._parser.receive(piece)
            for command in self._parser.events():
                if isinstance(command, WireError):
                    self._counts["refused"] += 1
                    yield from self._uart.send(encode_reply(Refused()))
                else:
                    yield from self._answer(command)

    def account(self) -> dict[str, object]:
        """Return what has passed: commands, faults that struck, seconds in all and in parts."""
        return {
            "commands": dict(self._counts),
            "faults": list(self.faults.struck),
            "seconds": self._now(),
            "motion_s": self._motion_s,
            "line_s": self._uart.busy,
        }

    def _now(self) -> float:
        """Return seconds since the start."""
        return self._clock.monotonic() - self._began

    def _answer(self, command: Command) -> Iterator[bytes | HangUp]:
        """Carry out one command with what goes wrong, and yield its reply."""
        name = {Step: "step", Read: "read"}.get(type(command), "other")
        self._counts[name] += 1
        struck = {f.kind: f for f in self.faults.strike(command, self._now())}
        if Kind.HANG_UP in struck:
            yield HangUp(struck[Kind.HANG_UP].by)
        reply = self._carry_out(command, struck)
        if reply is None or Kind.SILENCE in struck:
            return
        if Kind.LATE in struck:
            self._clock.sleep(struck[Kind.LATE].by or 0.0)
        data = encode_reply(reply)
        yield from self._uart.send(self._noise() if Kind.GARBAGE in struck else data)

    def _noise(self) -> bytes:
        """Return bytes that are no reply, as a wrong baud rate makes them."""
        return bytes(self.faults.rng.integers(0x80, 0x100, NOISE, dtype="u1")) + CR

    def _carry_out(self, command: Command, struck: dict[Kind, Fault]) -> Reply | None:
        """Return the reply to one command; None from an arm that has died."""
        if Kind.STUCK_OPEN in struck or Kind.STUCK_CLOSED in struck:
            self._stuck = Kind.STUCK_CLOSED in struck
        if Kind.LOST_STEPS in struck and isinstance(self._arm, Slips):
            loss = struck[Kind.LOST_STEPS]
            self._arm.slip(loss.motor, int(loss.by or 0))
        if Kind.RESTART in struck:
            self._arm.zero()
            self._program.clear()
        if Kind.REFUSED in struck:
            return Refused()
        try:
            if Kind.PENDANT in struck:
                return self._broken_off(command)
            return self._perform(command)
        except DeviceError as error:
            return StoppedByPendant() if error.cause is Cause.ARM_STOPPED_BY_PENDANT else None

    def _broken_off(self, command: Command) -> Reply:
        """Do a part of a motion: registers count only what was sent to the motors."""
        if isinstance(command, Step):
            share = self.faults.rng.uniform(0.2, 0.8)
            a, b, c, d, e, f = (round(share * s) for s in command.move.steps)
            self._move(StepMove((a, b, c, d, e, f), command.move.speed))
        return StoppedByPendant()

    def _perform(self, command: Command) -> Reply:
        """Let the arm do one command and return the reply. Raises DeviceError."""
        match command:
            case Step(move, _):
                self._move(move)
            case Read():
                return self._registers()
            case Reset():
                self._arm.zero()
            case Close(speed):
                self._close_gripper(CLOSING_SPEED if speed is None else speed)
            case Set() | Attention():
                pass  # nobody holds the pendant; the parser has taken the sign
            case Delay(gap):
                self._uart.gap = gap
            case Dump():
                return Dumped(tuple(self._program[n] for n in sorted(self._program)))
            case Write(words):
                self._program[words[0] % 256] = words
            case Run():
                return self._run()
        return Done()

    def _move(self, move: StepMove) -> None:
        """Let the arm do one motion."""
        self._motion_s += move.duration
        self._arm.step(move)

    def _contact(self) -> bool:
        """Return the grip switch, or where it is stuck."""
        return self._arm.read().contact if self._stuck is None else self._stuck

    def _registers(self) -> Registers:
        """Return what a READ says: 16-bit counts and the input byte."""
        pressed = self._contact() != self._active_low
        return Registers(_words(self._arm.read().registers), self._mask if pressed else 0)

    def _close_gripper(self, speed: int) -> None:
        """Close until the grip switch closes, or as far as the gripper goes."""
        move = StepMove((0, 0, 0, 0, 0, -GRIP_STEPS), speed)
        for _ in range(GRIP_RANGE // GRIP_STEPS):
            if self._contact():
                return
            self._move(move)

    def _run(self) -> Reply:
        """Make the stored program's moves in order; refuse one with steps of another kind."""
        targets = [move_to(self._program[n]) for n in sorted(self._program)]
        for target in targets:
            if target is None:
                return Refused()
        for target in filter(None, targets):
            here = _words(self._arm.read().registers)
            a, b, c, d, e, f = (t - h for t, h in zip(target.registers, here, strict=True))
            self._move(StepMove((a, b, c, d, e, f), target.speed))
        return Done()


def _words(registers: Steps) -> Steps:
    """Return counts as 16-bit registers hold them."""
    a, b, c, d, e, f = ((r + 0x8000) % 0x10000 - 0x8000 for r in registers)
    return a, b, c, d, e, f
