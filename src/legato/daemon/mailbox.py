"""Messages from other threads to the loop, with a file descriptor that wakes its poller.

Anyone may put; only the loop drains. The same descriptor serves signals.
"""

import socket
from collections import deque
from contextlib import suppress

from legato.daemon.messages import Message


class Mailbox:
    """A queue that a poller can wait for."""

    def __init__(self) -> None:
        self._messages: deque[Message] = deque()
        self._inside, self._outside = socket.socketpair()
        self._inside.setblocking(False)
        self._outside.setblocking(False)

    def fileno(self) -> int:
        """Return what becomes readable when there is something to drain."""
        return self._inside.fileno()

    def wake_fileno(self) -> int:
        """Return what a signal may write a byte to."""
        return self._outside.fileno()

    def put(self, message: Message) -> None:
        """Leave a message and wake the loop. Never blocks; after `close` nobody reads it."""
        self._messages.append(message)
        # A full pipe has already woken the loop; a closed one has no loop to wake.
        with suppress(OSError):
            self._outside.send(b"m")

    def drain(self) -> list[Message]:
        """Return all messages that have come, in their order."""
        with suppress(BlockingIOError):
            while self._inside.recv(4096):
                pass
        found = []
        with suppress(IndexError):
            while True:
                found.append(self._messages.popleft())
        return found

    def close(self) -> None:
        """Let go of the descriptors."""
        self._inside.close()
        self._outside.close()
