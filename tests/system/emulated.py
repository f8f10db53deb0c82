"""An emulator and a daemon that drives it over the pseudo-terminal: the cell without an arm.

Both draw the same world from one configuration: the daemon's simulated camera sees the leg that
the emulator's arm touches. What was truly touched the emulator alone knows.
"""

import json
import os
import signal
import subprocess
import sys
from ast import literal_eval
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from legato.cli.child import daemon
from legato.config.load import load
from legato.config.toml import dumps
from legato.daemon.client import Client
from legato.records.record import SessionRecord
from legato.records.store import Store

SCALE = 40.0
DWELL_S = 0.02
HOME = {"xyz_mm": [127.0, 0.0, 150.0], "pitch_deg": -90.0, "roll_deg": 0.0}

Tables = Mapping[str, Mapping[str, Any]]


class Cell:
    """An emulator at `scale` times true time, with the configuration of a daemon to drive it.

    `tables` are laid over the shipped configuration's, `sim` over its table of that name.
    """

    def __init__(
        self,
        folder: Path,
        *faults: str,
        scale: float = SCALE,
        tables: Tables | None = None,
        **sim: Any,
    ) -> None:
        self.folder = folder
        self.config = configuration(folder, tables, **sim)
        options = [part for text in faults for part in ("--fault", text)]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "legato.cli.leash", "emulate", "--json", *options,
             "--config", str(self.config), "--time-scale", str(scale),
             "--link", str(folder / "arm"), "--truth", str(folder / "truth.json"),
             "--line", str(folder / "line.txt")],
            env=os.environ | {"LEGATO_PARENT": str(os.getpid())},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )  # fmt: skip
        assert self.process.stdout is not None
        self.port = json.loads(self.process.stdout.readline())["port"]

    def truth(self) -> dict[str, Any]:
        """Return what truly happened so far; the emulator says when it has written it."""
        self.process.send_signal(signal.SIGUSR1)
        assert self.process.stderr is not None
        for line in self.process.stderr:
            if line.startswith("truth:"):
                break
        found: dict[str, Any] = json.loads((self.folder / "truth.json").read_text())
        return found

    def end(self) -> int:
        """End the emulator and return its exit code."""
        self.process.send_signal(signal.SIGTERM)
        try:
            self.process.communicate(timeout=20.0)
        finally:
            self.process.kill()
        return self.process.returncode

    def record(self, session: str) -> SessionRecord:
        """Return a session's record."""
        return Store(self.folder / "state").read(session)

    def passed(self) -> list[tuple[float, str, bytes]]:
        """Return what passed on the line: when (monotonic s), > to the arm or < from it, bytes."""
        found = []
        for line in (self.folder / "line.txt").read_text().splitlines():
            when, way, data = line.split(" ", 2)
            found.append((float(when), way, bytes(literal_eval(data))))
        return found

    def motions(self) -> list[tuple[float, bytes]]:
        """Return when the arm was sent each motion command."""
        return [(t, data) for t, way, data in self.passed() if way == ">" and b"@STEP" in data]


def configuration(folder: Path, tables: Tables | None = None, **sim: Any) -> Path:
    """Write a cell with the TeachMover's driver and the simulated camera."""
    data: dict[str, Any] = {name: dict(table) for name, table in load().data.items()}
    data["server"] = dict.fromkeys(("requests", "events", "stop"), "tcp://127.0.0.1:*")
    data["records"] |= {"state_dir": str(folder / "state"), "min_free_mb": 1}
    data["robot"] |= {"driver": "teachmover", "port": str(folder / "arm")}
    data["massage"] |= {"dwell_s": DWELL_S}
    for name, table in (tables or {}).items():
        data[name] |= table
    data["sim"] |= sim
    path = folder / "cell.toml"
    path.write_text(dumps(data, "Made by a test."), encoding="utf-8")
    return path


@contextmanager
def running(
    folder: Path,
    *faults: str,
    scale: float = SCALE,
    tables: Tables | None = None,
    **sim: Any,
) -> Iterator[tuple[Cell, Client]]:
    """Give an emulator, and a client of a daemon that drives it; the arm is referenced."""
    cell = Cell(folder, *faults, scale=scale, tables=tables, **sim)
    try:
        with daemon(cell.config, folder / "daemon.log") as (_, client):
            client.call("reference", **HOME)
            yield cell, client
    finally:
        assert cell.end() == 0


def ended(client: Client, method: str) -> dict[str, Any]:
    """Run a job to its end and return the answer of `wait`."""
    return outcome(client, client.call(method)["session"])


def outcome(client: Client, session: str) -> dict[str, Any]:
    """Wait for a session's end and return the answer of `wait`, with the session."""
    answer: dict[str, Any] = client.call("wait", session=session, timeout_s=4.0)
    while answer["outcome"] is None:
        answer = client.call("wait", session=session, timeout_s=4.0)
    return answer | {"session": session}
