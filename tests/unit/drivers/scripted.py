"""A serial port that answers by a script, and a driver on it."""

from collections.abc import Callable

import pytest

from legato.drivers.sim.clock import ManualClock
from legato.drivers.teachmover import POLL_S, TeachMover, TeachMoverSettings
from legato.geometry.motion import StepMove
from legato.hal.faults import Cause, DeviceError

MOVE = StepMove((10, 0, 0, 0, 0, 0), 183)
ANSWER = b"1\r1,2,3,4,5,6,0\r"
Reply = bytes | Exception


class ScriptedPort:
    """A port whose other end answers each write with the next scripted bytes, or an error.

    Reading an empty line costs the clock POLL_S, as a real one's time-out does.
    """

    def __init__(self, clock: ManualClock, replies: list[Reply]) -> None:
        self.clock = clock
        self.replies = replies
        self.written: list[bytes] = []
        self.incoming = bytearray()
        self.dripping: list[bytes] = []
        self.broken: Exception | None = None
        self.closed = False
        self.cut = 4096

    @property
    def in_waiting(self) -> int:
        """Bytes that have come in."""
        return len(self.incoming)

    def read(self, size: int = 1) -> bytes:
        """Return what is there, or wait in vain."""
        if self.broken is not None:
            raise self.broken
        if not self.incoming:
            self.clock.sleep(POLL_S)
            return self.dripping.pop(0) if self.dripping else b""
        size = min(size, self.cut)
        data = bytes(self.incoming[:size])
        del self.incoming[:size]
        return data

    def write(self, data: bytes) -> int:
        """Take a command and play the next reply."""
        self.written.append(data)
        reply = self.replies.pop(0) if self.replies else b""
        if isinstance(reply, Exception):
            raise reply
        self.incoming += reply
        return len(data)

    def reset_input_buffer(self) -> None:
        """Throw away what has come in."""
        if self.broken is not None:
            raise self.broken
        self.incoming.clear()

    def close(self) -> None:
        """Close; a vanished adapter complains even then."""
        self.closed = True
        if self.broken is not None:
            raise self.broken


def opened(
    *replies: Reply, switch_mask: int = 0x80, active_low: bool = False
) -> tuple[TeachMover, ScriptedPort, ManualClock]:
    """Return an open driver whose next commands get these replies."""
    clock = ManualClock()
    port = ScriptedPort(clock, [ANSWER, *replies])
    settings = TeachMoverSettings(
        port="/dev/arm", switch_mask=switch_mask, switch_active_low=active_low
    )
    arm = TeachMover(settings, clock, lambda _: port)
    arm.open()
    port.written.clear()
    return arm, port, clock


def cause_of(call: Callable[[], object]) -> Cause:
    """Return the cause that a call raises."""
    with pytest.raises(DeviceError) as caught:
        call()
    return caught.value.cause
