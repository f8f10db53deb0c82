"""The TeachMover on a serial line. The only home of pyserial.

One command is outstanding at a time, every wait ends, late bytes are thrown away, and after
anything odd the line is settled by a read before the next command: only then is a reply surely
the answer to what was asked. The arm's position is in doubt from the first byte of a motion until
its reply says done; once in doubt it stays so until the registers are zeroed.
"""

import termios
from collections.abc import Callable
from contextlib import suppress
from typing import Annotated, Protocol

from msgspec import Meta, Struct

from legato.drivers.line_log import CAME, SENT, LineLog
from legato.geometry.motion import StepMove
from legato.hal.arm import ArmReading
from legato.hal.clock import Clock
from legato.hal.faults import Cause, DeviceError
from legato.wire.teachmover import (
    Command,
    Done,
    Read,
    Refused,
    Registers,
    Reply,
    ReplyParser,
    Reset,
    Step,
    StoppedByPendant,
    encode,
)
from legato.wire.teachmover_lines import LONGEST_LINE, WireError

POLL_S = 0.05  # longest wait inside pyserial; silence for so long means that the line is quiet
BITS = 10  # of one character, 8N1
QUIET = 4  # characters whose time must pass before a slow line counts as quiet


class TeachMoverSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The arm's line; names are the configuration's keys."""

    port: str
    baud: Annotated[int, Meta(gt=0)] = 9600
    reply_margin_s: Annotated[float, Meta(gt=0)] = 1.0
    """How much longer than the motion and the line's own time a reply may take."""
    switch_mask: Annotated[int, Meta(ge=1, le=255)] = 0x80
    switch_active_low: bool = False


class Port(Protocol):
    """What the driver uses of `serial.Serial`; reads return early once POLL_S have passed."""

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read without waiting."""

    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes."""

    def write(self, data: bytes) -> int | None:
        """Send bytes."""

    def reset_input_buffer(self) -> None:
        """Throw away what has come in."""

    def close(self) -> None:
        """Let go of the device."""


def open_serial(settings: TeachMoverSettings) -> Port:
    """Open the port for this process alone. Raises OSError."""
    import serial

    port = serial.Serial(
        settings.port,
        settings.baud,
        timeout=POLL_S,
        write_timeout=settings.reply_margin_s + LONGEST_LINE * BITS / settings.baud,
        exclusive=True,
    )
    # USB adapters keep characters back for up to 16 ms, a third of what a read takes. Not all
    # obey: the kernel refuses, or pyserial says that this system has no such mode.
    with suppress(OSError, ValueError, NotImplementedError):
        port.set_low_latency_mode(True)
    return port


class TeachMover:
    """A TeachMover arm; every call ends, or raises DeviceError, within the motion plus a margin."""

    def __init__(
        self,
        settings: TeachMoverSettings,
        clock: Clock,
        open_port: Callable[[TeachMoverSettings], Port] = open_serial,
    ) -> None:
        self._settings = settings
        self._clock = clock
        self._open_port = open_port
        self._port: Port | None = None
        self._parser = ReplyParser()
        self._settled = False
        self._owes = False  # whether the answer to an earlier read may still come
        self._in_doubt = False
        self._line = LineLog(LONGEST_LINE)

    @property
    def simulated(self) -> bool:
        """False: whatever is at the other end of the line may move."""
        return False

    @property
    def position_in_doubt(self) -> bool:
        """Whether a motion was broken off, so that registers and arm may disagree."""
        return self._in_doubt

    @property
    def last_bytes(self) -> tuple[str, ...]:
        """The last chunks on the line, oldest first: time in s, direction, bytes. Evidence."""
        return self._line.told()

    def open(self) -> None:
        """Open the port and see that a TeachMover answers; open again after it was lost."""
        if self._port is not None:
            return
        try:
            self._port = self._open_port(self._settings)
        except (OSError, termios.error, ValueError) as error:
            raise DeviceError(
                Cause.ARM_LOST,
                f"cannot open {self._settings.port}: {error}",
                "see that the adapter is plugged in and that this user may use it",
            ) from error
        try:
            self._settle()
        except DeviceError:
            self.close()
            raise

    def close(self) -> None:
        """Let go of the port in any state; a device that has vanished is let go of silently."""
        port, self._port, self._settled = self._port, None, False
        if port is not None:
            try:
                port.close()
            except (OSError, termios.error):
                return

    def read(self) -> ArmReading:
        """Return registers and switch now."""
        match self._ask(Read()):
            case Registers(registers, inputs):
                pressed = bool(inputs & self._settings.switch_mask)
                return ArmReading(registers, pressed != self._settings.switch_active_low, inputs)
            case reply:
                raise self._unwelcome(reply, Read())

    def step(self, move: StepMove) -> ArmReading:
        """Carry out one motion command to its end, then return registers and switch."""
        command = Step(move)
        encode(command)  # a command that cannot be sent leaves no doubt
        before = self._in_doubt
        self._in_doubt = True
        reply = self._ask(command, move.duration)
        if isinstance(reply, Done | Refused):
            self._in_doubt = before
        if not isinstance(reply, Done):
            raise self._unwelcome(reply, command)
        return self.read()

    def zero(self) -> None:
        """Zero the registers where the arm stands; the motors' current drops until it moves."""
        reply = self._ask(Reset())
        if not isinstance(reply, Done):
            raise self._unwelcome(reply, Reset())
        self._in_doubt = False

    def _ask(self, command: Command, takes_s: float = 0.0) -> Reply:
        """Send one command on a settled line and return its reply."""
        if not self._settled:
            self._settle()
        return self._exchange(command, takes_s)

    def _settle(self) -> None:
        """Read registers until their answer comes through: all earlier replies then lie behind."""
        # The first may time out, and cut a late reply in two, whose rest then spoils the second.
        for last in (False, False, True):
            try:
                reply = self._exchange(Read())
            except DeviceError:
                if last or self._port is None:
                    raise
                continue
            if isinstance(reply, Registers):
                # They may be the answer to an earlier read, with the last one's still to come.
                slow = QUIET * BITS / self._settings.baud
                self._drain(self._settings.reply_margin_s if self._owes else slow)
                self._settled, self._owes = True, False
                return
            if last:
                raise self._unwelcome(reply, Read())

    def _drain(self, pause_s: float) -> None:
        """Throw away what still comes until nothing has for so long, or it babbles on and on."""
        heard = now = self._clock.monotonic()
        give_up = now + pause_s + self._settings.reply_margin_s
        while now < give_up:
            data = self._receive()
            now = self._clock.monotonic()
            if data:
                heard = now
            elif now - heard >= pause_s:
                return

    def _exchange(self, command: Command, takes_s: float = 0.0) -> Reply:
        """Send one command and return its reply. Raises DeviceError (arm_lost, arm_timeout)."""
        data = encode(command)
        line_s = (len(data) + LONGEST_LINE) * BITS / self._settings.baud
        allowed = takes_s + line_s + self._settings.reply_margin_s
        self._parser.reset()
        self._send(data)
        self._parser.expect(command)
        deadline, late = self._clock.monotonic() + allowed, False
        try:
            while (reply := self._parser.next_event()) is None:
                if late:
                    self._settled = False
                    self._owes = self._owes or isinstance(command, Read)
                    text = f"no reply to {data!r} within {allowed:.2f} s"
                    hint = "see that the arm is switched on and its cable plugged in"
                    raise DeviceError(Cause.ARM_TIMEOUT, text, hint)
                # One more look when the time is up: who was frozen finds the reply waiting.
                late = self._clock.monotonic() > deadline
                self._parser.receive(self._receive())
        except WireError as error:
            self._settled = False
            raise DeviceError(
                Cause.ARM_LOST, f"after {data!r}: {error}", "compare the baud rate with the arm's"
            ) from error
        self._settled = self._settled and isinstance(reply, Done | Registers)
        return reply

    def _send(self, data: bytes) -> None:
        """Throw away late bytes, then write."""
        port = self._connected()
        try:
            port.reset_input_buffer()
            self._line.add(self._clock.monotonic(), SENT, data)
            port.write(data)
        except (OSError, termios.error) as error:
            raise self._lost(error) from error

    def _receive(self) -> bytes:
        """Return what comes in within POLL_S, at once if something is there."""
        port = self._connected()
        try:
            data = port.read(max(1, port.in_waiting))
        except (OSError, termios.error) as error:
            raise self._lost(error) from error
        if data:
            self._line.add(self._clock.monotonic(), CAME, data)
        return data

    def _connected(self) -> Port:
        """Return the port. Raises DeviceError where there is none."""
        if self._port is None:
            raise DeviceError(
                Cause.ARM_LOST, f"{self._settings.port} is not open", "reset opens it again"
            )
        return self._port

    def _lost(self, error: Exception) -> DeviceError:
        """Let go of a port that has vanished, and return what to raise."""
        self.close()
        return DeviceError(
            Cause.ARM_LOST,
            f"{self._settings.port} has vanished: {error}",
            "plug the adapter in again, then reset",
        )

    def _unwelcome(self, reply: Reply, command: Command) -> DeviceError:
        """Return what to raise for a reply that is not the one hoped for."""
        if isinstance(reply, StoppedByPendant):
            return DeviceError(
                Cause.ARM_STOPPED_BY_PENDANT,
                f"STOP was pressed on the teach pendant during {encode(command)!r}",
                "see why, then reset and reference the arm",
            )
        return DeviceError(
            Cause.ARM_REFUSED,
            f"the arm refused {encode(command)!r}",
            "see that the arm is in serial mode and speaks this protocol",
        )
