"""Messages from other threads to the loop, with a file descriptor that wakes its poller.

Anyone may put; only the loop drains. The same descriptor serves signals.
"""

import socket
from collections import deque
from contextlib import suppress

from legato.daemon.messages import Message

MOST = 1000  # messages that may wait before those are lost that only the log needs


class Bell:
    """A file descriptor that any thread can make readable, and that one poller waits for."""

    def __init__(self) -> None:
        self._inside, self._outside = socket.socketpair()
        self._inside.setblocking(False)
        self._outside.setblocking(False)

    def fileno(self) -> int:
        """Return what becomes readable when the bell has rung."""
        return self._inside.fileno()

    def wake_fileno(self) -> int:
        """Return what a signal may write a byte to."""
        return self._outside.fileno()

    def ring(self) -> None:
        """Wake the poller. Never blocks; after `close` nobody hears it."""
        # A full pipe has already woken the poller.
        with suppress(OSError):
            self._outside.send(b"r")

    def silence(self) -> None:
        """Forget the ringing so far."""
        with suppress(BlockingIOError):
            while len(self._inside.recv(4096)) == 4096:
                pass

    def close(self) -> None:
        """Let go of the descriptors."""
        self._inside.close()
        self._outside.close()


class Mailbox(Bell):
    """A queue that a poller can wait for."""

    def __init__(self) -> None:
        super().__init__()
        self._messages: deque[Message] = deque()

    def put(self, message: Message) -> None:
        """Leave a message and wake the loop. Never blocks; after `close` nobody reads it."""
        self._messages.append(message)
        self.ring()

    def offer(self, message: Message) -> None:
        """Leave a message that may be lost: it is, where the loop is far behind."""
        if len(self._messages) < MOST:
            self.put(message)

    def drain(self) -> list[Message]:
        """Return all messages that have come, in their order."""
        self.silence()
        found = []
        with suppress(IndexError):
            while True:
                found.append(self._messages.popleft())
        return found
