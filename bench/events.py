"""Five hundred events a second to eight subscribers, one of which stands still for a while.

The real daemon publishes; each subscriber is a process with legato's own client. What the stalled
one missed must be found missing and replayed whole.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from bench.process import serving
from bench.row import Row, keep
from legato.daemon.client import Client

RATE, SECONDS, SUBSCRIBERS = 500.0, 20.0, 8
LATE_MS = 2.0
STALL_S = (2.0, 12.0)  # of the job: more events than any queue on the way holds

SUBSCRIBER = """
import json, sys, time
from legato.daemon.client import Client
seen, late = [], []
with Client(sys.argv[1], sys.argv[2]) as client:
    client.call("ping")
    print("ready", flush=True)
    for topic, event in client.events(5.0):
        now = time.monotonic()
        if topic == "progress":
            seen.append(event["done"])
            late.append(now - event["sent"])
        if topic == "session" and event["outcome"]:
            break
    print(json.dumps({"seen": seen, "late": late, "lost": client.lost}))
"""


def run() -> list[Row]:
    """Return how late events come, and what was lost."""
    with tempfile.TemporaryDirectory() as name:
        told = [json.loads(text) for text in listened(Path(name))]
    rows = list(figures(told))
    keep("events", rows)
    return rows


def listened(folder: Path) -> list[str]:
    """Return what each subscriber tells; the first was stopped in the middle."""
    module, more = ("bench.metronome",), (str(RATE), str(SECONDS))
    simulated = {"sim": {"time_scale": 1.0}}
    with serving(folder / "cell", None, tables=simulated, command=module, more=more) as ends:
        command = [sys.executable, "-c", SUBSCRIBER, ends["requests"], ends["events"]]
        listeners = [
            subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(SUBSCRIBERS)
        ]
        for one in listeners:
            assert one.stdout is not None
            assert one.stdout.readline() == "ready\n"
        with Client(ends["requests"]) as client:
            client.call("home")
        time.sleep(STALL_S[0])
        os.kill(listeners[0].pid, signal.SIGSTOP)
        time.sleep(STALL_S[1] - STALL_S[0])
        os.kill(listeners[0].pid, signal.SIGCONT)
        return [one.communicate(timeout=60.0)[0] for one in listeners]


def figures(told: list[dict]) -> list[Row]:  # type: ignore[type-arg]  # JSON
    """Return the rows of what the subscribers have told."""
    stalled, others = told[0], told[1:]
    late = 1e3 * np.concatenate([t["late"] for t in others])
    every = list(range(round(RATE * SECONDS)))
    missing = sum(len(set(every) - set(t["seen"])) for t in told)
    untold = sum(max(len(every) - len(t["seen"]) - t["lost"], 0) for t in told)
    disordered = sum(t["seen"] != sorted(set(t["seen"])) for t in told)
    worst = float(max(np.percentile(t["late"], 99) for t in others)) * 1e3
    behind = float(max(stalled["late"]))
    note = f"{len(others)} subscribers, {len(late)} events; worst of them {worst:.2f}"
    return [
        Row("events: written to heard, p50", float(np.percentile(late, 50)), "ms", note=note),
        Row("events: written to heard, p99", float(np.percentile(late, 99)), "ms", LATE_MS),
        Row("events: not heard in the end, the stalled one's too", missing, "", 0,
            note=f"the stalled one fell {behind:.1f} s behind"),
        Row("events: lost without a sign", untold, "", 0),
        Row("events: subscribers that heard out of order", disordered, "", 0),
    ]  # fmt: skip
