"""Lines on their way to a file descriptor: whoever writes them never waits for whoever reads them.

One thread writes, in the order in which lines came. While nobody takes them, so many wait as fit;
those that come on top are lost, and counted.
"""

import atexit
import os
import select
import threading
from collections import deque
from typing import Final

MOST_BYTES: Final = 1 << 20  # that may wait
DRAIN_S: Final = 1.0  # how long the end of the process waits for who reads slowly


class Outlet:
    """A text stream as structlog uses it, over a descriptor that stays its owner's."""

    def __init__(self, descriptor: int, most_bytes: int = MOST_BYTES) -> None:
        self._descriptor = descriptor
        self._most = most_bytes
        self._lines: deque[bytes] = deque()
        self._size = self._lost = 0
        self._rest = b""  # the other half of a line of which one half stands there
        self._ended = False
        self._thread: threading.Thread | None = None
        self._change = threading.Condition()
        # A daemon thread ends with the process, however long its reader sleeps.
        atexit.register(self.close)

    def write(self, text: str) -> int:
        """Leave a line for the thread; it is lost where too much waits already."""
        line = text.encode(errors="backslashreplace")
        with self._change:
            if self._ended or self._size + len(line) > self._most:
                self._lost += 1
                return len(text)
            self._lines.append(line)
            self._size += len(line)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="log", daemon=True)
                self._thread.start()
            self._change.notify()
        return len(text)

    def flush(self) -> None:
        """Do nothing: lines leave as soon as they are taken."""

    def take_lost(self) -> int:
        """Return how many lines were lost since this was asked last, once there is room again."""
        with self._change:
            if self._size > self._most // 2:
                return 0
            lost, self._lost = self._lost, 0
            return lost

    def close(self, timeout_s: float = DRAIN_S) -> bool:
        """Take no more lines, and give those that wait some time to leave; say whether all have."""
        with self._change:
            self._ended = True
            self._change.notify()
        if self._thread is not None:
            self._thread.join(timeout_s)
        atexit.unregister(self.close)
        return self._thread is None or not self._thread.is_alive()

    def _run(self) -> None:
        while True:
            with self._change:
                while not self._lines:
                    if self._ended:
                        return
                    self._change.wait()
                line = self._lines.popleft()
            self._put(line)
            with self._change:
                self._size -= len(line)

    def _put(self, line: bytes) -> None:
        """Write one line, and first what is left of the one before it."""
        owed = len(self._rest)
        left = memoryview(self._rest + line)
        whole = len(left)
        while left:
            try:
                left = left[os.write(self._descriptor, left) :]
            except BlockingIOError:  # its other users want it so
                select.select([], [self._descriptor], [])
            except OSError:  # no room, nobody there, closed
                break
        written = whole - len(left)
        if not left or written > owed:
            self._rest = bytes(left)
            return
        self._rest = self._rest[written:]
        with self._change:
            self._lost += 1
