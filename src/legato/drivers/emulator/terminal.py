"""A serial port of the kernel's making, a pseudo-terminal, with an emulator behind it.

Any TeachMover software can open it. Hanging up closes it, as an adapter that is pulled out does;
plugging in again makes another.
"""

import errno
import os
import select
import threading
import tty
from collections.abc import Callable

from legato.drivers.emulator.controller import Emulator, HangUp

CHUNK = 4096
GONE = (errno.EIO, errno.EBADF)


class PseudoTerminal:
    """A line on which `emulator` answers; a context manager.

    `opened` is told the port's path, now and whenever the line is plugged in again. `passed` is
    told each chunk as it passes: ">" toward the robot, "<" from it. `busy` is held while a command
    is carried out.
    """

    def __init__(
        self,
        emulator: Emulator,
        opened: Callable[[str], None] = lambda _: None,
        passed: Callable[[str, bytes], None] = lambda _, __: None,
    ) -> None:
        self._emulator = emulator
        self._opened = opened
        self._passed = passed
        self._ends: tuple[int, int] | None = None
        self._wake, self._alarm = os.pipe()
        self.busy = threading.Lock()
        self.path = ""
        self._plug_in()

    def __enter__(self) -> "PseudoTerminal":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def serve(self) -> None:
        """Answer until `stop`; blocks, so give it a thread or the process."""
        while (data := self._receive()) is not None:
            back_s: float | None = None
            self._passed(">", data)
            with self.busy:
                for out in self._emulator.talk(data):
                    if isinstance(out, HangUp):
                        back_s = out.back_s
                        self._unplug()
                    else:
                        self._send(out)
            if self._ends is None and back_s is not None:
                if self._stopped(back_s):
                    return
                self._plug_in()

    def stop(self) -> None:
        """End `serve`, from any thread, once it has done with the command at hand."""
        os.write(self._alarm, b"!")

    def close(self) -> None:
        """Hang up for good. Ends nothing that still runs: `stop` and wait for `serve` first."""
        self._unplug()
        for fd in (self._wake, self._alarm):
            _shut(fd)

    def _receive(self) -> bytes | None:
        """Return the next bytes; None when told to stop or when the line fails."""
        near = [] if self._ends is None else [self._ends[0]]
        ready, _, _ = select.select([*near, self._wake], [], [])
        if self._wake in ready:
            return None
        try:
            return os.read(near[0], CHUNK)
        except OSError as error:
            if error.errno in GONE:
                return None
            raise

    def _send(self, data: bytes) -> None:
        """Put bytes on the line, if it is there."""
        if self._ends is None:
            return
        self._passed("<", data)
        try:
            os.write(self._ends[0], data)
        except BlockingIOError:
            return  # nobody reads: without handshake the bytes are lost, as on the real line
        except OSError as error:
            if error.errno not in GONE:
                raise

    def _stopped(self, seconds: float) -> bool:
        """Wait, and say whether `stop` was called meanwhile."""
        return bool(select.select([self._wake], [], [], seconds)[0])

    def _plug_in(self) -> None:
        """Make the terminal and tell its path."""
        near, far = os.openpty()
        # The far end stays open here, or the near end would hang up with the last client.
        self._ends = near, far
        tty.setraw(far)
        os.set_blocking(near, False)
        self.path = os.ttyname(far)
        self._opened(self.path)

    def _unplug(self) -> None:
        """Close both ends."""
        ends, self._ends = self._ends, None
        for fd in ends or ():
            _shut(fd)


def _shut(fd: int) -> None:
    """Close a descriptor that may be closed already."""
    try:
        os.close(fd)
    except OSError:
        return
