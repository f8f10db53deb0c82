"""The daemon under systemd: the real process, a real socket of its kind, a driver that hangs."""

import json
import os
import socket
import subprocess
import sys
import threading
import tomllib
import urllib.request
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from legato.config.toml import dumps
from tests.system.process import configuration, daemon


class Systemd:
    """Hears what is told to $NOTIFY_SOCKET, and may wait for it."""

    def __init__(self, path: Path) -> None:
        self.lines: list[str] = []
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(path))
        self._came = threading.Condition()
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def until(self, line: str, after: int = 0) -> int:
        """Wait for a line that begins so, and return how many lines there were with it."""
        with self._came:
            found = self._came.wait_for(lambda: self._find(line, after), 60.0)
        assert found, f"no {line} in {self.lines[after:]}"
        return self._find(line, after)

    def close(self) -> None:
        """Hear no more."""
        with closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as own:
            own.sendto(b"", self._socket.getsockname())
        self._thread.join()
        self._socket.close()

    def _find(self, line: str, after: int) -> int:
        for number, heard in enumerate(self.lines[after:], start=after + 1):
            if heard.startswith(line):
                return number
        return 0

    def _listen(self) -> None:
        while told := self._socket.recv(4096):
            with self._came:
                self.lines += told.decode().splitlines()
                self._came.notify_all()


@pytest.fixture
def systemd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Systemd]:
    """Return a listener that the daemons of this test tell."""
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
    monkeypatch.setenv("WATCHDOG_USEC", "30000000")
    with closing(Systemd(tmp_path / "notify")) as made:
        yield made


def changed(file: Path, **tables: dict[str, Any]) -> Path:
    """Add keys to a configuration's tables."""
    data = tomllib.loads(file.read_text(encoding="utf-8"))
    for name, keys in tables.items():
        data[name] = data.get(name, {}) | keys
    file.write_text(dumps(data, "Made by a test."), encoding="utf-8")
    return file


def test_ready_with_the_devices_fed_while_all_is_well_stopping_at_the_end(
    tmp_path: Path, systemd: Systemd
) -> None:
    """READY=1 first of all with the devices known, then food, a status a state, STOPPING=1.

    The page of metrics shows the session that was run meanwhile.
    """
    file = changed(configuration(tmp_path, time_scale=400.0), metrics={"listen": "127.0.0.1:0"})
    with daemon(file) as running:
        ready = systemd.until("READY=1")
        assert "WATCHDOG=1" not in systemd.lines[:ready]
        assert running.do("status")["arm"]["connected"]
        running.wait(running.do("capture")["session"])
        captured = systemd.until("STATUS=capture; session ", ready)
        systemd.until("WATCHDOG=1", captured)
        with urllib.request.urlopen(running.logged("metrics")[0]["url"], timeout=20.0) as page:
            text = page.read().decode()
        assert 'legato_sessions_total{job="capture",outcome="done"} 1.0' in text
        assert 'legato_effect_seconds_count{effect="Grab"} 1.0' in text
    last = systemd.until("STOPPING=1", captured)
    assert running.process.returncode == 0
    assert not [line for line in systemd.lines[last:] if "READY" in line]


def test_ready_too_where_a_device_is_known_to_be_missing(tmp_path: Path, systemd: Systemd) -> None:
    """A daemon without its camera is up, and says what it lacks."""
    faults = [{"kind": "camera_lost", "on": "open", "call": 1, "for_s": 1e5}]
    with daemon(configuration(tmp_path, faults=faults)):
        number = systemd.until("READY=1")
        systemd.until("STATUS=idle; no camera", number)


def test_the_watchdog_starves_while_a_driver_hangs(tmp_path: Path, systemd: Systemd) -> None:
    """A call that lasts longer than it may: no food, although the loop still answers."""
    faults = [{"kind": "arm_blocks", "on": "step", "call": 3, "by": 2500.0}]
    file = changed(
        configuration(tmp_path, faults=faults, time_scale=500.0), robot={"reply_margin_s": 0.1}
    )
    with daemon(file) as running:
        systemd.until("WATCHDOG=1", systemd.until("READY=1"))
        running.do("run")
        stuck = systemd.until("STATUS=stuck: Move; massage_7; session ")
        for _ in range(2):
            running.event("heartbeat")
        assert running.do("ping")["state"] == "massage_7"
        assert "WATCHDOG=1" not in systemd.lines[stuck - 1 :]
        assert running.logged("worker_stuck")
        # The call returns in the end: the daemon is well again, and ends in order.
        systemd.until("WATCHDOG=1", stuck)


def test_a_second_daemon_ends_with_a_clear_line(tmp_path: Path) -> None:
    """One state folder has one daemon: the second says who is there, and touches nothing."""
    file = configuration(tmp_path)
    with daemon(file) as running:
        second = subprocess.run(
            [sys.executable, "-m", "legato", "serve", "--config", str(file)],
            capture_output=True,
            text=True,
            timeout=60.0,
            env={**os.environ, "NOTIFY_SOCKET": ""},
            check=False,
        )
        assert second.returncode == 1
        (line,) = [json.loads(line) for line in second.stderr.splitlines()]
        assert line["event"] == "already_running"
        assert str(running.process.pid) in line["text"]
        assert running.do("ping")["state"] == "idle"
