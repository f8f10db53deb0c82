"""Encryption end to end: keys from the command line, roles, refusals, who asked in the record."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from legato.config.load import load
from legato.config.toml import dumps
from tests.system.process import ANY

CLIENTS = {"anna": "operator", "ben": "observer", "cleo": "stopper"}


def legato(*args: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a command."""
    command = [sys.executable, "-m", "legato", *map(str, args)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


class Encrypted:
    """A daemon on encrypted lines, and the configurations of its clients."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        keygen(folder, "cell", "server")
        keygen(folder, "eve", "operator")
        for name, role in CLIENTS.items():
            keygen(folder / "clients", name, role)
        lines = {name: f"ipc://{folder}/{name}" for name in ("requests", "events", "stop")}
        curve = {"secret": str(folder / "cell.secret"), "clients": str(folder / "clients")}
        data: dict[str, Any] = {name: dict(table) for name, table in load().data.items()}
        data["records"] |= {"state_dir": str(folder / "state"), "min_free_mb": 1}
        self.config = write(folder / "cell.toml", data | {"server": lines | {"curve": curve}})
        for name in (*CLIENTS, "eve"):
            where = folder / ("clients" if name in CLIENTS else ".")
            keys = {"client_secret": str(where / f"{name}.secret"),
                    "server_public": str(folder / "cell.public")}  # fmt: skip
            write(folder / f"{name}.toml", {"server": lines | keys})
        write(folder / "plain.toml", {"server": lines})
        self.log = folder / "log"
        with self.log.open("wb") as stream:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "legato", "serve", "--config", str(self.config)],
                stdout=stream,
                stderr=stream,
            )
        self.logged("ready")

    def ask(self, who: str, *command: str) -> subprocess.CompletedProcess[str]:
        """Run a command as somebody."""
        return legato(*command, "--config", self.folder / f"{who}.toml", "--json")

    def logged(self, event: str) -> list[dict[str, Any]]:
        """Return the log's lines of an event, once there are some."""
        for _ in range(600):
            text = self.log.read_text()
            lines = [json.loads(line) for line in text.splitlines() if line.startswith("{")]
            found = [line for line in lines if line["event"] == event]
            if found:
                return found
            time.sleep(0.05)
        raise AssertionError(f"no {event} in {text}")

    def close(self) -> None:
        """End the process."""
        self.process.terminate()
        assert self.process.wait(30.0) == 0


def keygen(folder: Path, name: str, role: str) -> None:
    """Make a key pair as a person does."""
    made = legato("keygen", "--name", name, "--role", role, "--out", folder, "--json")
    assert made.returncode == 0, made.stderr
    secret = Path(json.loads(made.stdout)["secret"])
    assert secret.stat().st_mode & 0o777 == 0o600


def write(path: Path, data: dict[str, Any]) -> Path:
    """Write a configuration."""
    path.write_text(dumps(data, "Made by a test."), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Encrypted]:
    """Give an encrypted daemon."""
    made = Encrypted(tmp_path_factory.mktemp("c"))
    yield made
    made.close()


def test_each_role_may_do_what_it_may(cell: Encrypted) -> None:
    """All read; cleo may also stop; anna may act. Refusals end with 3 and say whom it takes."""
    for who in CLIENTS:
        status = cell.ask(who, "status")
        assert status.returncode == 0, status.stderr
        assert json.loads(status.stdout)["state"] == "idle"
    for who in ("ben", "cleo"):
        refused = cell.ask(who, "home")
        assert refused.returncode == 3
        assert "operator" in refused.stderr
    refused = cell.ask("ben", "stop")
    assert (refused.returncode, "stopper" in refused.stderr) == (3, True)
    assert cell.ask("cleo", "stop").returncode == 0


def test_who_asked_is_in_every_record(cell: Encrypted) -> None:
    """Session, events and log name the key that asked for the job, and the one that stopped it."""
    home = cell.ask("anna", "home")
    assert home.returncode == 0, home.stderr
    session = json.loads(home.stdout)["session"]
    folder = cell.folder / "state" / "sessions" / session
    assert json.loads((folder / "session.json").read_text())["by"] == "anna"
    assert cell.ask("cleo", "estop").returncode == 0
    assert cell.logged("fault")[-1]["cause"] == "estop"
    assert "cleo" in cell.logged("fault")[-1]["text"]
    assert cell.logged("stop_line")[-1]["by"] == "cleo"
    assert cell.ask("anna", "reset").returncode == 0
    assert cell.logged("request")[-1]["by"] == "anna"


@pytest.mark.parametrize("who", ["eve", "plain"])
def test_who_is_not_listed_is_told_and_logged(cell: Encrypted, who: str) -> None:
    """A key that nobody listed and no key at all: refused by name, on every line, and logged."""
    for command in ("status", "estop"):
        refused = cell.ask(who, command)
        assert refused.returncode == 3, refused.stderr
        assert "key refused" in refused.stderr
    assert cell.logged("turned_away")
    assert json.loads(cell.ask("ben", "status").stdout)["state"] == "idle"


def test_secrets_that_others_can_read_are_refused(cell: Encrypted, tmp_path: Path) -> None:
    """Neither daemon nor client uses one; the line says file, key and what to do."""
    loose = tmp_path / "loose.secret"
    loose.write_text((cell.folder / "cell.secret").read_text())
    loose.chmod(0o644)
    text = cell.config.read_text().replace(str(cell.folder / "cell.secret"), str(loose))
    config = tmp_path / "cell.toml"
    config.write_text(text.replace(str(cell.folder / "state"), str(tmp_path / "state")))
    refused = legato("serve", "--config", config)
    assert refused.returncode == 2
    assert "server.curve.secret" in refused.stderr
    assert "chmod 600" in refused.stderr
    text = (cell.folder / "anna.toml").read_text()
    own = str(cell.folder / "clients" / "anna.secret")
    client = tmp_path / "anna.toml"
    client.write_text(text.replace(own, str(loose)))
    assert legato("status", "--config", client).returncode == 2


def test_beyond_loopback_takes_encryption(tmp_path: Path) -> None:
    """Without keys a daemon that others could reach does not start."""
    data: dict[str, Any] = {name: dict(table) for name, table in load().data.items()}
    data["server"] = {"requests": "tcp://192.0.2.1:5760", "events": ANY, "stop": ANY}
    refused = legato("serve", "--config", write(tmp_path / "cell.toml", data))
    assert refused.returncode == 2
    assert "encryption" in refused.stderr
