"""Bytes cut into the TeachMover's lines, which end with CR only, and the numbers in a line.

A parser never raises anything but WireError, whatever the bytes and however they were split.
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Generic, TypeVar

CR = b"\r"
LONGEST_LINE = 80
INT16 = (-32768, 32767)
WORD = (0, 65535)

_NUMBER = re.compile(rb"[+-]?[0-9]{1,5}", re.ASCII)


class WireError(Exception):
    """The other side sent what the protocol does not know; the text shows the bytes."""


class Lines:
    """Bytes cut at CR; a line that is too long is one error, and its rest is skipped."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._skipping = False

    def receive(self, data: bytes) -> None:
        """Take in bytes."""
        self._buffer += data

    def next_line(self) -> bytes | None:
        """Return the next line without its CR and outer blanks, or None until there is one."""
        end = self._buffer.find(CR)
        if self._skipping:
            del self._buffer[: end + 1 if end >= 0 else len(self._buffer)]
            self._skipping = end < 0
            return None if end < 0 else self.next_line()
        if end > LONGEST_LINE or (end < 0 and len(self._buffer) > LONGEST_LINE):
            self._skipping = True
            begin = bytes(self._buffer[:LONGEST_LINE])
            raise WireError(f"a line of more than {LONGEST_LINE} characters: {begin!r}")
        if end < 0:
            return None
        line = bytes(self._buffer[:end])
        del self._buffer[: end + 1]
        return line.strip(b" \n")

    def clear(self) -> None:
        """Throw away what is left."""
        self._buffer.clear()
        self._skipping = False


Message = TypeVar("Message")


class Parser(ABC, Generic[Message]):
    """Bytes in, messages out; after an error only `reset` helps."""

    def __init__(self) -> None:
        self._lines = Lines()
        self._error: WireError | None = None

    def receive(self, data: bytes) -> None:
        """Take in bytes, however they were split."""
        if self._error is None:
            self._lines.receive(data)

    def next_event(self) -> Message | None:
        """Return the next message, or None until more bytes come. Raises WireError."""
        if self._error is not None:
            raise self._error
        try:
            while (line := self._lines.next_line()) is not None:
                message = self._message(line)
                if message is not None:
                    return message
        except WireError as error:
            self._error = error
            raise
        return None

    def events(self) -> Iterator[Message]:
        """Yield every message that the bytes so far hold. Raises WireError."""
        while (message := self.next_event()) is not None:
            yield message

    def reset(self) -> None:
        """Forget bytes and errors."""
        self._lines.clear()
        self._error = None

    @abstractmethod
    def _message(self, line: bytes) -> Message | None:
        """Return what a line says, None where it says nothing by itself. Raises WireError."""


def numbers(text: bytes) -> list[int] | None:
    """Return the whole numbers, of at most five digits, that commas part; None for other text.

    Blanks about a number and one comma at the end are tolerated.
    """
    if not text.strip(b" "):
        return []
    parts = [part.strip(b" ") for part in text.rstrip(b" ").removesuffix(b",").split(b",")]
    if not all(map(_NUMBER.fullmatch, parts)):
        return None
    return [int(part) for part in parts]


def within(name: str, value: int, low: int = INT16[0], high: int = INT16[1]) -> int:
    """Return a value that lies in its range. Raises ValueError."""
    if not low <= value <= high:
        raise ValueError(f"{name} is {low} to {high}, not {value}")
    return value
