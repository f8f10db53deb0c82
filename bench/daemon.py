"""The daemon's line beside a bare ROUTER of the same run, plain and encrypted; stops; cold start.

The floor is a ROUTER with a poller that answers each request with the same bytes, in a process of
its own. Ratios within one run count, not the microseconds.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import zmq

from bench.process import free_ports, megabytes, secrets, serving, until
from bench.row import Row, keep
from bench.stopline import STOP_P99_MS, stops
from legato.daemon.client import Client
from legato.daemon.keys import Keys, read_secret
from legato.records.store import Store

ROUNDS, CALLS, WARM = 40, 250, 20
STARTS, COMMANDS, BLOCK_S = 7, 300, 3.0
STATUS_P50, STATUS_P99 = 1.3, 1.5
BUSY_P99_MS, BLOCKED_P99_MS, ACCEPTED_P99_MS = 20.0, 5.0, 5.0
START_S, IDLE_MB = 0.6, 80.0

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
        rows += [*blocked(folder / "blocked"), *accepted(folder / "accepted")]
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


def accepted(folder: Path) -> Iterator[Row]:
    """Yield how soon a command's new state is on disk and heard by who listens."""
    with serving(folder, None) as ends, Client(ends["requests"]) as client:
        context = zmq.Context()
        heard = context.socket(zmq.SUB)
        heard.subscribe(b"state")
        heard.connect(ends["events"])
        heard.recv_multipart()  # the present state: the subscription stands
        spent, bare = [], []
        for _ in range(COMMANDS):
            bare.append(written(Store(folder / "bare"), client.call("describe")))
            began = time.perf_counter()
            client.call("home")
            # An event leaves when its line in the record has been synced.
            while json.loads(heard.recv_multipart()[1])["state"] != "move_home":
                pass
            spent.append(time.perf_counter() - began)
            until(lambda: client.call("status")["state"] == "idle")
        heard.close(linger=0)
        context.term()
    for share, limit in ((50, None), (99, ACCEPTED_P99_MS)):
        late, least = (float(1e3 * np.percentile(times, share)) for times in (spent, bare))
        yield Row(f"daemon: command sent to state recorded and heard, p{share}", late, "ms", limit,
                  peer=least, note=f"{COMMANDS} commands; beside the record alone")  # fmt: skip


def written(store: Store, config: Any) -> float:
    """Return how long the record of a session's beginning takes by itself, on the same disk."""
    began, now = time.perf_counter(), datetime.now(UTC).isoformat()
    record = store.begin({"job": "home", "started": now, "simulated": True, "config": config})
    record.event("state", {"state": "move_home"}, t=began, wall=now, durable=True)
    spent = time.perf_counter() - began
    record.close()
    return spent


def blocked(folder: Path) -> Iterator[Row]:
    """Yield round trips of status, and one stop, while a driver's call blocks."""
    faults = [{"kind": "arm_blocks", "call": 1, "by": BLOCK_S}]
    away = [150.0, 0.0, 150.0]  # home is somewhere else
    tables = {"sim": {"time_scale": 1.0, "arm_at_mm": away, "faults": faults}}
    with serving(folder, None, tables=tables) as ends, Client(ends["requests"]) as client:
        client.call("home")
        ends_at = time.monotonic() + BLOCK_S * 0.9
        spent = []
        while time.monotonic() < ends_at:
            began = time.perf_counter()
            state = client.call("status")["state"]
            spent.append(time.perf_counter() - began)
            assert state == "move_home", state
            time.sleep(0.001)
        with Client(ends["stop"]) as line:
            asked = time.monotonic()
            told = line.call("stop", timeout_s=0)
        assert told["confirmed"] is None, "the call has blocked no longer"
    late = float(1e3 * np.percentile(spent, 99))
    yield Row("daemon: status while a driver's call blocks, p99", late, "ms", BLOCKED_P99_MS,
              note=f"{len(spent)} calls in {0.9 * BLOCK_S:.1f} s")  # fmt: skip
    commanded = 1e3 * (told["commanded"] - asked)
    yield Row("daemon: stop asked to commanded, call blocked", commanded, "ms", STOP_P99_MS)


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
