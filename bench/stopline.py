"""A thousand stops on the stop line at random moments of every state of the real daemon."""

import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench.process import serving, until
from bench.row import Row
from legato.daemon.client import Client, RpcError

STOPS = 1000
STOP_P99_MS, STOP_MAX_MS = 20.0, 50.0
# The jobs that are broken off, so many of a thousand, and how late at the most. What finds the leg
# anew comes last: the passes need what was found.
PLAN = (
    ("massage", 450, 0.4), ("home", 150, 0.05), ("capture", 100, 0.05), ("pause", 100, 0.0),
    ("idle", 50, 0.0), ("fault", 50, 0.0), ("verify", 50, 0.1), ("calibrate", 50, 0.3),
)  # fmt: skip


def stops(folder: Path) -> Iterator[Row]:
    """Yield how late the driver was told to stop, counted by the state that the stop met."""
    rng = np.random.default_rng(1)
    late: list[float] = []
    confirmed: list[float] = []
    met: Counter[str] = Counter()
    with serving(folder, None) as ends, Client(ends["requests"]) as client:
        client.call("wait", session=client.call("run")["session"])
        with Client(ends["stop"]) as line:
            for what, count, longest in PLAN:
                for _ in range(count * STOPS // 1000):
                    _bring_about(client, line, what)
                    time.sleep(float(rng.uniform(0.0, longest)))
                    met[line.call("ping")["state"].partition("_")[0]] += 1
                    asked = time.monotonic()
                    told = line.call("stop", timeout_s=5.0)
                    late.append(1e3 * (told["commanded"] - asked))
                    confirmed.append(1e3 * (told["confirmed"] - asked))
                    _to_idle(client)
    note = ", ".join(f"{state} {n}" for state, n in met.most_common())
    p99 = float(np.percentile(late, 99))
    yield Row("daemon: stop asked to driver commanded, p99", p99, "ms", STOP_P99_MS, note=note)
    yield Row("daemon: stop asked to driver commanded, longest", max(late), "ms", STOP_MAX_MS,
              note=f"{len(late)} stops")  # fmt: skip
    p99 = float(np.percentile(confirmed, 99))
    yield Row("daemon: stop asked to confirmed by the driver, p99", p99, "ms")


def _bring_about(client: Client, line: Client, what: str) -> None:
    """Begin a job, or bring about a state that is no job's."""
    match what:
        case "idle":
            pass
        case "fault":
            line.call("estop")
        case "pause":
            client.call("massage")
            until(lambda: client.call("status")["state"].startswith("massage"))
            client.call("pause")
            until(lambda: client.call("status")["state"] in ("paused", "idle"))
        case _:
            client.call(what)


def _to_idle(client: Client) -> None:
    """Wait for the job's end; leave a fault."""
    until(lambda: client.call("status")["state"] in ("idle", "fault"))
    if client.call("status")["state"] == "fault":
        until(lambda: _left(client))


def _left(client: Client) -> bool:
    try:
        client.call("reset")
    except RpcError as error:
        if error.message != "busy":
            raise
        return False
    return True
