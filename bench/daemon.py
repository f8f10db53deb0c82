"""The daemon's line beside a bare ROUTER of the same run, plain and encrypted; stops; cold start.

The floor is a ROUTER with a poller that answers each request with the same bytes, in a process of
its own. Ratios within one run count, not the microseconds.
"""

import json
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import zmq

from bench.row import Row, keep
from legato.config.load import load
from legato.config.toml import dumps
from legato.daemon.client import Client
from legato.daemon.keys import Keys, make_keys, read_public, read_secret

ROUNDS, CALLS, WARM = 40, 250, 20
STOPS, PASSES = 1000, 900
STARTS = 7
STATUS_P50, STATUS_P99 = 1.3, 1.5
BUSY_P99_MS, STOP_P99_MS, STOP_MAX_MS = 20.0, 20.0, 50.0
START_S, IDLE_MB = 0.6, 80.0
LINES = ("requests", "events", "stop")

FLOOR = """
import sys, zmq
router = zmq.Context().socket(zmq.ROUTER)
if len(sys.argv) > 2:
    router.curve_server, router.curve_publickey, router.curve_secretkey = (
        True, sys.argv[2].encode(), sys.argv[3].encode())
router.bind(sys.argv[1])
poller = zmq.Poller()
poller.register(router, zmq.POLLIN)
answer = sys.stdin.buffer.readline().rstrip()
while True:
    poller.poll()
    route, _ = router.recv_multipart()
    router.send_multipart([route, answer])
"""


def run() -> list[Row]:
    """Return the figures of the line."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = [*line(folder / "plain", None), *line(folder / "curve", secrets(folder))]
        rows += [*stops(folder / "stops"), *starts(folder / "starts")]
    keep("daemon", rows)
    return rows


def line(folder: Path, keys: tuple[Keys, dict[str, Any]] | None) -> Iterator[Row]:
    """Yield round trips of status, idle and during a solve, over the floor's."""
    kind, own = ("plain", None) if keys is None else ("CURVE", keys[0])
    with serving(folder, keys) as ends, Client(ends["requests"], keys=own) as client:
        told = json.dumps(client.call("status")).encode()
        with floor(told, keys) as at, Client(at, keys=own) as bare:
            status, least = turn_about(client, bare)
        client.call("wait", session=client.call("run")["session"])
        busy = during(client, "calibrate")
    for share, limit in ((50, STATUS_P50), (99, STATUS_P99)):
        spent, floor_s = np.percentile(status, share), np.percentile(least, share)
        yield Row(f"daemon: status {kind}, p{share}", 1e6 * spent, "us", peer=1e6 * floor_s)
        ratio = float(spent / floor_s)
        yield Row(f"daemon: the same over the floor, {kind}, p{share}", ratio, "", limit)
    late = float(1e3 * np.percentile(busy, 99))
    yield Row(f"daemon: status {kind} during a solve, p99", late, "ms", BUSY_P99_MS,
              note=f"{len(busy)} calls")  # fmt: skip


def turn_about(one: Client, other: Client) -> tuple[list[float], list[float]]:
    """Return round trips of two clients, taken turn about: what else runs disturbs both alike."""
    found: tuple[list[float], list[float]] = ([], [])
    for number in range(ROUNDS):
        for client, times in zip((one, other), found, strict=True):
            times += round_trips(client)[WARM if number else -1 :]
    return found


def round_trips(client: Client) -> list[float]:
    """Return how long bare requests for status take on a client's socket."""
    line = client._connected().socket
    request = json.dumps({"jsonrpc": "2.0", "id": 1, "method": "status", "params": {}}).encode()
    found = []
    for _ in range(CALLS):
        began = time.perf_counter()
        line.send(request)
        line.recv()
        found.append(time.perf_counter() - began)
    return found


def during(client: Client, job: str) -> list[float]:
    """Return round trips of status while a job runs, again and again until there are enough."""
    found: list[float] = []
    while len(found) < 300:
        session = client.call(job)["session"]
        state = ""
        while state != "idle":
            began = time.perf_counter()
            state = client.call("status")["state"]
            found.append(time.perf_counter() - began)
            time.sleep(0.001)
        client.call("wait", session=session)
    return found


def stops(folder: Path) -> Iterator[Row]:
    """Yield how long stops take at random moments of a job, by the daemon's own count too."""
    rng = np.random.default_rng(1)
    spent = []
    with serving(folder, None) as ends, Client(ends["requests"]) as client:
        client.call("wait", session=client.call("run")["session"])
        with Client(ends["stop"]) as line:
            for number in range(STOPS):
                # What finds the leg anew comes last: the passes need what was found.
                jobs = ("massage", "home", "capture") if number < PASSES else ("calibrate",)
                client.call(jobs[number % len(jobs)])
                time.sleep(float(rng.uniform(0.0, 0.05)))
                began = time.perf_counter()
                line.call("stop")
                spent.append(time.perf_counter() - began)
                until(lambda: client.call("status")["state"] == "idle")
            told = client.call("status")["stop"]["commanded"]
    yield Row("daemon: stop, received to commanded, longest", told["max_ms"], "ms", STOP_MAX_MS,
              note=f"{told['count']} stops")  # fmt: skip
    late = float(1e3 * np.percentile(spent, 99))
    yield Row("daemon: stop, asked to confirmed by the driver, p99", late, "ms")


def starts(folder: Path) -> Iterator[Row]:
    """Yield how soon a cold daemon answers, and the memory that it takes when idle."""
    seconds = []
    for number in range(STARTS):
        began = time.perf_counter()
        with serving(folder / str(number), None, wait=False) as ends:
            context = zmq.Context()
            caller = context.socket(zmq.DEALER)
            caller.linger = 0
            caller.setsockopt(zmq.RECONNECT_IVL, 5)
            caller.connect(ends["requests"])
            caller.send(b'{"jsonrpc": "2.0", "id": 1, "method": "status"}')
            caller.poll()
            seconds.append(time.perf_counter() - began)
            caller.close()
            context.term()
    yield Row("daemon: cold start to first answer, median", float(np.median(seconds)), "s", START_S)
    cells: tuple[tuple[str, dict[str, str]], ...] = (
        ("real drivers, nothing connected", {"robot": "teachmover", "camera": "opencv"}),
        ("simulated cell", {}),
    )
    for name, drivers in cells:
        with serving(folder / name, None, drivers) as ends:
            time.sleep(1.0)
            yield Row(f"daemon: memory when idle, {name}", megabytes(int(ends["pid"])), "MB",
                      IDLE_MB if drivers else None)  # fmt: skip


@contextmanager
def serving(
    folder: Path,
    keys: tuple[Keys, dict[str, Any]] | None,
    drivers: Mapping[str, str] | None = None,
    *,
    wait: bool = True,
) -> Iterator[dict[str, str]]:
    """Give the lines of a daemon of its own, and its process id; it ends with this."""
    folder.mkdir(parents=True)
    data: dict[str, Any] = {name: dict(table) for name, table in load(None).data.items()}
    ends = {name: f"tcp://127.0.0.1:{port}" for name, port in zip(LINES, free_ports(), strict=True)}
    data["server"] = ends | (keys[1] if keys is not None else {})
    data["records"] |= {"state_dir": str(folder / "state"), "min_free_mb": 1}
    for table, driver in (drivers or {}).items():
        data[table]["driver"] = driver
    data["robot"]["port"], data["camera"]["source"] = str(folder / "no-arm"), str(folder / "none")
    config, log = folder / "cell.toml", folder / "log"
    config.write_text(dumps(data, "Made by `python -m bench daemon`."), encoding="utf-8")
    command = [sys.executable, "-m", "legato", "serve", "--config", str(config)]
    with log.open("wb") as stream:
        process = subprocess.Popen(command, stdout=stream, stderr=stream)
    try:
        if wait:
            until(lambda: b'"ready"' in log.read_bytes())
        yield ends | {"pid": str(process.pid)}
    finally:
        process.terminate()
        process.wait(30.0)


@contextmanager
def floor(told: bytes, keys: tuple[Keys, dict[str, Any]] | None) -> Iterator[str]:
    """Give the address of a bare ROUTER that answers everything with `told`."""
    at = f"tcp://127.0.0.1:{next(free_ports())}"
    own = []
    if keys is not None:
        server = read_secret(Path(keys[1]["curve"]["secret"]), "")
        own = [server.public.decode(), server.secret.decode()]
    command = [sys.executable, "-c", FLOOR, at, *own]
    process = subprocess.Popen(command, stdin=subprocess.PIPE)
    try:
        assert process.stdin is not None
        process.stdin.write(told + b"\n")
        process.stdin.flush()
        yield at
    finally:
        process.kill()
        process.communicate()


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
