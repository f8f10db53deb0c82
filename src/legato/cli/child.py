"""A daemon as a child process: started, waited for, and ended whatever happens.

It dies with its parent, and what it logs stays in a file.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legato.cli.exits import EXITS, Exit, Failure

if TYPE_CHECKING:
    from legato.daemon.client import Client

READY_S = 30.0
END_S = 10.0
POLL_S = 0.02


@dataclass(frozen=True)
class Endpoints:
    """Where a daemon that is ready listens."""

    requests: str
    events: str


class Child:
    """A running `legato serve`."""

    def __init__(self, config: Path, log: Path) -> None:
        self.log = log
        with log.open("wb") as stream:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "legato.cli.leash", "serve", "--config", str(config)],
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                env=os.environ | {"LEGATO_PARENT": str(os.getpid())},
                start_new_session=True,  # a Ctrl-C is for the parent, which then asks for a stop
            )

    def ready(self, timeout_s: float = READY_S) -> Endpoints:
        """Return where the daemon listens, once it says so; raises Failure where it does not."""
        give_up = time.monotonic() + timeout_s
        while time.monotonic() < give_up:
            ended = self._process.poll()
            for line in self.lines():
                if line.get("event") == "ready":
                    return Endpoints(str(line["requests"]), str(line["events"]))
            if ended is not None:
                raise Failure(f"the daemon ended at once: {self.last()}", code_of(ended))
            time.sleep(POLL_S)
        raise Failure(f"the daemon was not ready within {timeout_s:.0f} s: {self.last()}")

    def lines(self) -> Iterator[dict[str, Any]]:
        """Yield what the daemon has logged as JSON, whole lines only."""
        for line in self.log.read_bytes().splitlines(keepends=True):
            try:
                document = json.loads(line) if line.endswith(b"\n") else None
            except ValueError:
                continue
            if isinstance(document, dict):
                yield document

    def last(self) -> str:
        """Return what the daemon said last, for a person."""
        logged = [line for line in self.lines() if line.get("level") == "error"]
        if logged:
            return f"{logged[-1].get('text')} ({logged[-1].get('hint')})"
        lines = self.log.read_text(encoding="utf-8", errors="replace").split("\n")
        written = [line.strip() for line in lines if line.strip()]
        return written[-1] if written else "it wrote nothing"

    def end(self, client: "Client | None") -> None:
        """Ask for a shutdown, then make sure of it."""
        if client is not None and self._process.poll() is None:
            try:
                client.call("shutdown")
                self._process.wait(END_S)
            except Exception as error:  # noqa: BLE001  # whatever is wrong, the process must end
                with self.log.open("a", encoding="utf-8") as stream:
                    stream.write(f"shutdown by request failed: {error}\n")
        for end in (self._process.terminate, self._process.kill):
            if self._process.poll() is None:
                end()
                try:
                    self._process.wait(END_S)
                except subprocess.TimeoutExpired:
                    continue


@contextmanager
def daemon(config: Path, log: Path) -> "Iterator[tuple[Child, Client]]":
    """Give a daemon that is ready and a client of it; both end when this does."""
    from legato.daemon.client import Client

    child, client = Child(config, log), None
    try:
        found = child.ready()
        client = Client(found.requests, found.events)
        yield child, client
    finally:
        child.end(client)
        if client is not None:
            client.close()


def code_of(ended: int) -> Exit:
    """Return the exit code of a daemon as one of ours."""
    return Exit(ended) if ended in EXITS else Exit.FAILED
