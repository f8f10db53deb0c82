"""A daemon that is killed, frozen and started again at the same addresses, and a line to it.

The line is a bare DEALER that only knows JSON-RPC: it counts what is answered, and how late.
"""

import json
import os
import re
import secrets
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from tests.system.emulated import configuration
from tests.system.line import Line

LINES = ("requests", "events", "stop")
PORTS = range(15_000, 32_000)
TIMES = re.compile(r", (\d+) times$")
LOOK_S = 0.5  # between two looks at whether it still runs
SERVE = ("-m", "legato", "serve", "--config")
LEASHED = ("-m", "legato.cli.leash", "serve", "--config")
SHORT: dict[str, dict[str, Any]] = {
    "leg": {"stations_mm": [7.0, 67.0]},
    "massage": {"strokes": 1},
    "calibration": {"fresh_s": 604_800.0},
    "robot": {"driver": "sim"},
}
"""A cell in this process's own memory whose run is short."""


class Places:
    """Three endpoints that no other is given until `close`, while their daemon is gone either.

    A socket that is bound and never listens keeps each port. They are none that the kernel gives
    to those who connect: a client that tries again and again while the daemon is gone would at
    last be given the very port, and meet itself there.
    """

    def __init__(self) -> None:
        self._kept = [_kept_port() for _ in LINES]
        ports = [kept.getsockname()[1] for kept in self._kept]
        self.lines = {
            name: f"tcp://127.0.0.1:{port}" for name, port in zip(LINES, ports, strict=True)
        }

    def close(self) -> None:
        """Let others have them."""
        for kept in self._kept:
            kept.close()


def _kept_port() -> socket.socket:
    """Return a socket that is bound to a port of its own, which a daemon may bind as well."""
    for _ in range(1000):
        kept = socket.socket()
        try:
            kept.bind(("127.0.0.1", secrets.choice(PORTS)))
        except OSError:
            kept.close()
            continue
        # Set afterwards: it lets in whoever sets it, and had to find the port free itself.
        kept.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        return kept
    raise OSError("no port is free")


class Attacked:
    """`legato serve` on fixed addresses; `before` is a command line that starts Python instead."""

    def __init__(
        self,
        folder: Path,
        tables: Mapping[str, Mapping[str, Any]] = SHORT,
        *,
        before: Sequence[str] = (sys.executable,),
        environment: Mapping[str, str] | None = None,
        **sim: Any,
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.state_dir = folder / "state"
        self.log = folder / "daemon.log"
        self._places = Places()
        self.lines = self._places.lines
        server = self.lines | dict(tables.get("server", {}))
        self.config = configuration(folder, {**tables, "server": server}, **sim)
        self.starts = self.mark = 0
        self._before = tuple(before)
        self._environment = os.environ | {"LEGATO_PARENT": str(os.getpid()), **(environment or {})}
        self.process = self.begin()
        self.until_listening()

    def begin(self) -> "subprocess.Popen[bytes]":
        """Start it; it appends to its log, after `mark` bytes."""
        with self.log.open("ab") as stream:
            self.mark = stream.tell()
            self.process = subprocess.Popen(
                [*self._before, *LEASHED, str(self.config)],
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                env=self._environment,
            )
        self.starts += 1
        return self.process

    def until_listening(self, give_up_s: float = 30.0) -> None:
        """Wait until it says that it listens; fail where it has ended instead."""
        give_up = time.monotonic() + give_up_s
        while not self.logged("listening", since=self.mark):
            assert self.process.poll() is None, self.log.read_text()[-2000:]
            assert time.monotonic() < give_up, self.log.read_text()[-2000:]
            time.sleep(0.02)

    def kill(self) -> float:
        """Kill it as a power cut would; return the monotonic s at which it was gone."""
        self.process.kill()
        self.process.wait(20.0)
        return time.monotonic()

    def second(self) -> "subprocess.CompletedProcess[str]":
        """Start another on the same configuration, and return how it ended."""
        command = [sys.executable, *SERVE, str(self.config)]
        return subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)

    def send_signal(self, number: int) -> None:
        """Send the process a signal."""
        os.kill(self.process.pid, number)

    def close(self) -> None:
        """End it, whatever state it is in."""
        if self.process.poll() is None:
            self.send_signal(signal.SIGCONT)
            self.process.terminate()
        try:
            self.process.wait(40.0)
        finally:
            self.process.kill()
            self.process.wait()
            self._places.close()

    def answer(self, line: Line, number: int, give_up_s: float) -> dict[str, Any]:
        """Return the answer to a request; raises TimeoutError, and AssertionError if it ends."""
        until = time.monotonic() + give_up_s
        while (left := until - time.monotonic()) > 0:
            with suppress(TimeoutError):
                return line.answer(number, min(left, LOOK_S))
            assert self.process.poll() is None, f"it ended with {self.process.returncode}"
        raise TimeoutError(f"no answer to {line.pending.get(number)} in {give_up_s:g} s")

    def back(self, line: Line, give_up_s: float = 30.0) -> tuple[dict[str, Any], float]:
        """Return what status first says after `begin`, and how long that took."""
        began, before = time.monotonic(), line.slowest
        answer = self.answer(line, line.send("status"), give_up_s)
        line.slowest = before  # a start is no answer's latency
        return answer, time.monotonic() - began

    def logged(self, event: str | None = None, since: int = 0) -> list[dict[str, Any]]:
        """Return what it has logged after so many bytes, whole lines only."""
        found = []
        for line in self.log.read_bytes()[since:].splitlines(keepends=True):
            if line.startswith(b"{") and line.endswith(b"\n"):
                found.append(json.loads(line))
        return [line for line in found if event in (None, line.get("event"))]

    def turned_away(self) -> int:
        """Return how many refusals at the door its log tells of; one line may be of many."""
        found = (TIMES.search(line["why"]) for line in self.logged("turned_away"))
        return sum(int(times[1]) if times else 1 for times in found)

    def turned_away_after(self, refusals: int, within_s: float = 10.0) -> int:
        """Return the same once it is more than `refusals`: a line may be a second late."""
        give_up = time.monotonic() + within_s
        while (found := self.turned_away()) <= refusals and time.monotonic() < give_up:
            time.sleep(0.05)
        return found

    def said(self) -> list[str]:
        """Return what it wrote that is no log line: a traceback, a library's complaint."""
        lines = self.log.read_text(errors="replace").splitlines()
        return [line for line in lines if line.strip() and not line.startswith("{")]

    def orphans(self) -> list[int]:
        """Return the processes that name this configuration, beside the one that was started."""
        found = []
        for entry in Path("/proc").glob("[0-9]*/cmdline"):
            try:
                words = entry.read_bytes().split(b"\0")
            except OSError:
                continue
            pid = int(entry.parent.name)
            if b"serve" in words and str(self.config).encode() in words:
                found += [pid] if pid != self.process.pid else []
        return found

    def megabytes(self) -> float:
        """Return the memory that it holds."""
        text = Path(f"/proc/{self.process.pid}/status").read_text(encoding="ascii")
        (line,) = (t for t in text.splitlines() if t.startswith("VmRSS"))
        return int(line.split()[1]) / 1024.0

    def descriptors(self) -> int:
        """Return how many files and sockets it has open."""
        return len(list(Path(f"/proc/{self.process.pid}/fd").iterdir()))


@contextmanager
def attacked(folder: Path, *args: Any, **options: Any) -> Iterator[Attacked]:
    """Give a daemon to attack; it ends with this."""
    cell = Attacked(folder, *args, **options)
    try:
        yield cell
    finally:
        cell.close()
