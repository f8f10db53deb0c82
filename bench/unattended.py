"""The daemon under systemd: its unit's exposure, its start, its second instance.

Needs `systemd-analyze` (Debian: systemd), which is no part of what legato needs to run.
"""

import hashlib
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from bench.row import Row, keep
from legato.config.load import load
from legato.config.toml import dumps

UNIT = Path(__file__).resolve().parent.parent / "systemd" / "legato.service"
MOST_EXPOSED = 1.5
SECOND_S = 1.0
STARTS = 7
OVERALL = re.compile(r"Overall exposure level for \S+: (?P<level>[\d.]+)")


def run() -> list[Row]:
    """Return the figures; the hash in the result says of which unit they are."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = [*unit(folder), *instances(folder)]
    keep("unattended", rows, unit_sha256=hashlib.sha256(UNIT.read_bytes()).hexdigest())
    return rows


def unit(folder: Path) -> Iterator[Row]:
    """Yield what systemd-analyze says of the shipped unit."""
    if shutil.which("systemd-analyze") is None:
        raise SystemExit("bench unattended needs systemd-analyze: apt-get install systemd")
    told = analyzed("security", "--offline=true", str(UNIT))
    found = OVERALL.search(told)
    assert found is not None, told
    version = analyzed("--version").split()[1]
    note = f"systemd {version}"
    yield Row("unattended: exposure of the unit", float(found["level"]), "", MOST_EXPOSED,
              note=note)  # fmt: skip
    # The installed path is not there on this machine: this interpreter stands in for it.
    copy = folder / UNIT.name
    copy.write_text(UNIT.read_text().replace("/usr/local/bin/legato", sys.executable))
    complaints = analyzed("verify", str(copy)).splitlines()
    yield Row("unattended: complaints of systemd-analyze verify", len(complaints), "", 0,
              note="; ".join(complaints))  # fmt: skip


def analyzed(*arguments: str) -> str:
    """Return what systemd-analyze says."""
    command = ["systemd-analyze", "--no-pager", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


def instances(folder: Path) -> Iterator[Row]:
    """Yield how soon READY=1 comes, and how soon a second daemon is gone."""
    file = configuration(folder)
    ready, second = [], []
    for number in range(STARTS):
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
            place = folder / f"notify-{number}"
            ear.bind(str(place))
            ear.settimeout(60.0)
            began = time.monotonic()
            first = started(file, str(place))
            try:
                while b"READY=1" not in ear.recv(4096):
                    pass
                ready.append(time.monotonic() - began)
                began = time.monotonic()
                code = started(file, "").wait(60.0)
                second.append(time.monotonic() - began)
                assert code == 1, f"the second daemon ended with {code}"
            finally:
                first.terminate()
                first.wait(60.0)
    yield Row("unattended: start to READY=1, both devices known", max(ready), "s",
              note=f"slowest of {STARTS}")  # fmt: skip
    yield Row("unattended: a second daemon's end", max(second), "s", SECOND_S,
              note=f"slowest of {STARTS}")  # fmt: skip


def configuration(folder: Path) -> Path:
    """Write the simulated cell with its own state folder and free ports."""
    data = {name: dict(table) for name, table in load().data.items()}
    data["server"] = dict.fromkeys(("requests", "events", "stop"), "tcp://127.0.0.1:*")
    data["records"] |= {"state_dir": str(folder / "state")}
    file = folder / "cell.toml"
    file.write_text(dumps(data, "Made by a bench."), encoding="utf-8")
    return file


def started(file: Path, notify: str) -> "subprocess.Popen[bytes]":
    """Start a daemon."""
    command = [sys.executable, "-m", "legato", "serve", "--config", str(file)]
    environment = {**os.environ, "NOTIFY_SOCKET": notify}
    return subprocess.Popen(command, stderr=subprocess.DEVNULL, env=environment)
