"""The serial line's time: when characters have come in, and when they have gone out.

Moments are absolute, so that late sleepers do not add up. Without a baud rate nothing takes time.
"""

from collections.abc import Iterator

from legato.hal.clock import Clock
from legato.wire.teachmover_lines import CR

BITS = 10  # of one character, 8N1


class Uart:
    """One end of a line of `baud` bits a second on `clock`."""

    def __init__(self, clock: Clock, baud: int | None) -> None:
        self._clock = clock
        self._character = 0.0 if baud is None else BITS / baud
        self._in_free = self._out_free = clock.monotonic()
        self.gap = 0
        """Idle characters after each that is sent: what `@DELAY` sets [inferred]."""
        self.busy = 0.0
        """Seconds for which the line has carried characters, either way."""

    def receive(self, data: bytes) -> Iterator[bytes]:
        """Yield data that has just been sent to us, a line at a time, each once it is all here."""
        when = max(self._in_free, self._clock.monotonic())
        self._in_free = when + len(data) * self._character
        for piece in _lines(data):
            when += len(piece) * self._character
            self.busy += len(piece) * self._character
            self._clock.sleep(when - self._clock.monotonic())
            yield piece

    def send(self, data: bytes) -> Iterator[bytes]:
        """Yield data as its characters go out: as many at a time as are due."""
        each = self._character * (1 + self.gap)
        began = max(self._out_free, self._clock.monotonic())
        self._out_free = began + len(data) * each
        self.busy += len(data) * self._character
        sent = 0
        while sent < len(data):
            self._clock.sleep(began + (sent + 1) * each - self._clock.monotonic())
            due = (self._clock.monotonic() - began) / each if each else len(data)
            upto = min(max(sent + 1, int(due)), len(data))
            yield data[sent:upto]
            sent = upto


def _lines(data: bytes) -> list[bytes]:
    """Return data cut after each CR."""
    *lines, rest = data.split(CR)
    return [line + CR for line in lines] + ([rest] if rest else [])
