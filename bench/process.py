"""A real daemon in a process of its own, for a bench: its lines, keys, memory, and its end."""

import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

from legato.config.load import load
from legato.config.toml import dumps
from legato.daemon.keys import Keys, make_keys, read_public, read_secret

LINES = ("requests", "events", "stop")


@contextmanager
def serving(
    folder: Path,
    keys: tuple[Keys, dict[str, Any]] | None,
    drivers: Mapping[str, str] | None = None,
    *,
    wait: bool = True,
    tables: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
    command: Sequence[str] = ("legato", "serve", "--config"),
    more: Sequence[str] = (),
) -> Iterator[dict[str, str]]:
    """Give the lines of a daemon of its own, and its process id; it ends with this.

    `tables` change its configuration, whose path comes between the module `command` and `more`.
    """
    folder.mkdir(parents=True)
    data: dict[str, Any] = {name: dict(table) for name, table in load(None).data.items()}
    ends = {name: f"tcp://127.0.0.1:{port}" for name, port in zip(LINES, free_ports(), strict=True)}
    data["server"] = ends | (keys[1] if keys is not None else {})
    data["records"] |= {"state_dir": str(folder / "state"), "min_free_mb": 1}
    for table, driver in (drivers or {}).items():
        data[table]["driver"] = driver
    data["robot"]["port"], data["camera"]["source"] = str(folder / "no-arm"), str(folder / "none")
    for table, values in tables.items():
        data[table] = data.get(table, {}) | dict(values)
    config, log = folder / "cell.toml", folder / "log"
    config.write_text(dumps(data, "Made by `make bench`."), encoding="utf-8")
    line = [sys.executable, "-m", *command, str(config), *more]
    with log.open("wb") as stream:
        process = subprocess.Popen(line, stdout=stream, stderr=stream)
    try:
        if wait:
            until(lambda: b'"ready"' in log.read_bytes())
        yield ends | {"pid": str(process.pid)}
    finally:
        process.terminate()
        process.wait(30.0)


def secrets(folder: Path) -> tuple[Keys, dict[str, Any]]:
    """Make the keys of a daemon and a client; return the client's, and the daemon's table."""
    secret, public = make_keys(folder, "cell", "server")
    mine, _ = make_keys(folder / "clients", "anna", "operator")
    own = read_secret(mine, "")
    keys = Keys(own.public, own.secret, read_public(public, "").public.encode())
    return keys, {"curve": {"secret": str(secret), "clients": str(folder / "clients")}}


def free_ports() -> Iterator[int]:
    """Yield ports of loopback that were free a moment ago, three at most."""
    with ExitStack() as held:
        for _ in LINES:
            taken = held.enter_context(socket.create_server(("127.0.0.1", 0)))
            yield int(taken.getsockname()[1])


def until(holds: Callable[[], bool], give_up_s: float = 60.0) -> None:
    """Wait until something is so."""
    give_up = time.monotonic() + give_up_s
    while not holds():
        assert time.monotonic() < give_up, "it has not come to be"
        time.sleep(0.002)


def megabytes(pid: int) -> float:
    """Return the memory that a process holds."""
    for text in Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines():
        if text.startswith("VmRSS"):
            return int(text.split()[1]) / 1024.0
    raise ValueError(f"process {pid} has no memory")
