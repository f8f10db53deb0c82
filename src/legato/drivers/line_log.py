"""The last bytes of a serial line with their times: what a fault shows as evidence."""

from collections import deque
from typing import Final

KEPT: Final = 40  # chunks
SENT, CAME = ">", "<"


class LineLog:
    """Keeps the last chunks; what comes in piece by piece, `longest` bytes at most, is one."""

    def __init__(self, longest: int) -> None:
        self._longest = longest
        self._chunks: deque[tuple[float, str, bytes]] = deque(maxlen=KEPT)

    def add(self, t: float, way: str, data: bytes) -> None:
        """Keep bytes that were SENT or CAME at `t`, in the cell's s."""
        if way == CAME and self._chunks and self._chunks[-1][1] == way:
            began, _, before = self._chunks[-1]
            if len(before) + len(data) <= self._longest:
                self._chunks[-1] = (began, way, before + data)
                return
        self._chunks.append((t, way, data))

    def told(self) -> tuple[str, ...]:
        """Return the chunks, oldest first: time of the first byte in s, direction, bytes."""
        return tuple(f"{t:.3f} {way} {data!r}" for t, way, data in self._chunks)
