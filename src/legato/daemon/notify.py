"""What systemd is told: ready, status, stopping, and that daemon and worker are alive.

One datagram each to $NOTIFY_SOCKET (sd_notify(3)); nothing where there is none. Nobody waits for
systemd, and no error of its socket reaches the daemon.
"""

import os
import socket
import time
from collections.abc import Callable, Mapping
from contextlib import suppress

from legato.daemon.log import Log
from legato.daemon.pulse import Pulse

LATE_S = 1.0  # a loop later than this with its heartbeat is not well
STATUS_LENGTH = 200


class Notifier:
    """The line to systemd; `environment` is the process's own."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        path = environment.get("NOTIFY_SOCKET", "")
        self._address = f"\0{path[1:]}" if path.startswith("@") else path
        self._socket: socket.socket | None = None
        if path.startswith(("/", "@")):
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)
        meant = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        usec = environment.get("WATCHDOG_USEC", "")
        self.watchdog_s = int(usec) / 1e6 if meant and usec.isdigit() and int(usec) else None

    def tell(self, *lines: str) -> None:
        """Send lines such as READY=1."""
        if self._socket is not None:
            with suppress(OSError):
                self._socket.sendto("\n".join(lines).encode(), self._address)

    def close(self) -> None:
        """Let go of the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class Supervised:
    """Feeds the watchdog with each heartbeat, as long as the loop is on time and the worker lives.

    `beat` is called by the loop with every heartbeat of the cell, `every_s` apart.
    """

    def __init__(
        self,
        notifier: Notifier,
        pulse: Pulse,
        log: Log,
        *,
        every_s: float,
        status: Callable[[], str],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self.late_s = 0.0
        self._notifier = notifier
        self._pulse = pulse
        self._log = log
        self._every_s = every_s
        self._status = status
        self._now = now
        self._beaten_at: float | None = None
        self._last_status = ""
        self._overdue: str | None = None
        self._ready = self._ending = False

    def ready(self) -> None:
        """Tell that the daemon is up: both devices are known, or known to be missing."""
        self._ready = True
        self._notifier.tell("READY=1", f"STATUS={self._fresh_status()}")

    def stopping(self) -> None:
        """Tell once that the daemon ends."""
        if not self._ending:
            self._ending = True
            self._notifier.tell("STOPPING=1", "STATUS=ending")

    def beat(self) -> None:
        """Take note of a heartbeat; feed the watchdog where all is well."""
        now, before = self._now(), self._beaten_at
        self._beaten_at = now
        self.late_s = max(now - before - self._every_s, 0.0) if before is not None else 0.0
        overdue = self._pulse.overdue()
        if overdue is not None and overdue != self._overdue:
            self._log.error("worker_stuck", doing=overdue, watchdog_s=self._notifier.watchdog_s)
        self._overdue = overdue
        if self._ready and self.late_s < LATE_S and overdue is None:
            self._notifier.tell("WATCHDOG=1")
        self.changed()

    def changed(self) -> None:
        """Tell the status where it is another than before."""
        before = self._last_status
        if not self._ending and self._fresh_status() != before:
            self._notifier.tell(f"STATUS={self._last_status}")

    def _fresh_status(self) -> str:
        text = self._status().replace("\n", " ")[:STATUS_LENGTH]
        self._last_status = text if self._overdue is None else f"stuck: {self._overdue}; {text}"
        return self._last_status
