"""Stops and emergency stops at random moments of the passes, over the real daemon's line.

The cell runs at ten times true time, so that the computer's own delay counts tenfold: figures are
in the cell's seconds, from the request's arrival to the end of the last motion it did not ask for.
"""

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from bench.row import Row, keep
from legato.cli.child import daemon
from legato.config.load import load
from legato.config.toml import dumps
from legato.daemon.client import Client
from legato.records.record import SessionRecord
from legato.records.store import Store

STOPS, ESTOPS = 200, 50
TIME_SCALE = 10.0
LONGEST_WAIT_S = 3.5  # of the wall's: a set of passes lasts about 4
LIMIT_S = 0.25


def run() -> list[Row]:
    """Return how long motion goes on after a stop and after an estop, and what follows it."""
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as folder:
        state = Path(folder)
        with daemon(configured(state), state / "log") as (_, client):
            for job in ("capture", "calibrate", "verify"):
                finish(client, job)
            stops = [interrupted(client, "stop", rng) for _ in range(STOPS)]
            estops = [interrupted(client, "estop", rng) for _ in range(ESTOPS)]
        store = Store(state)
        after_stop = [motion_after(store.read(s), "stopping") for s in stops if s]
        after_estop = [motion_after(store.read(s), "fault") for s in estops if s]
    late = [t for t, _ in after_stop]
    rows = [
        Row("stops: in the middle of a massage", len(after_stop), "", STOPS * 0.9, at_least=True),
        Row("stops: other motion after one, worst", max(late), "s", LIMIT_S),
        Row("stops: other motion after one, median", float(np.median(late)), "s"),
        Row("stops: not followed by the retract alone", sum(o for _, o in after_stop), "", 0),
        Row("stops: motion after an estop, worst", max(t for t, _ in after_estop), "s", LIMIT_S),
        Row("stops: commands after the one in flight", sum(o for _, o in after_estop), "", 0),
    ]
    keep("stops", rows, time_scale=TIME_SCALE, estops=len(after_estop))
    return rows


def configured(state: Path) -> Path:
    """Write the simulated cell's configuration for this bench and return its path."""
    data = {name: dict(table) for name, table in load(None).data.items()}
    data["server"] |= dict.fromkeys(("requests", "events", "stop"), "tcp://127.0.0.1:*")
    data["records"]["state_dir"] = str(state)
    data["sim"]["time_scale"] = TIME_SCALE
    data["calibration"]["fresh_s"] = 86400.0  # of the cell: one calibration serves them all
    path = state / "cell.toml"
    path.write_text(dumps(data, "Made by `python -m bench stops`."), encoding="utf-8")
    return path


def finish(client: Client, job: str) -> None:
    """Run a job to its end."""
    session = client.call(job)["session"]
    ended = client.call("wait", session=session, timeout_s=60.0)
    assert ended["outcome"] == "done", ended


def interrupted(client: Client, how: str, rng: np.random.Generator) -> str | None:
    """Break off a massage at a random moment; None where it had ended before."""
    session = str(client.call("massage")["session"])
    time.sleep(float(rng.uniform(0.0, LONGEST_WAIT_S)))
    if client.call("status")["state"] == "idle":
        return None
    client.call(how)
    outcome = client.call("wait", session=session, timeout_s=60.0)["outcome"]
    if how == "estop":
        client.call("reset")
    return session if outcome in ("stopped", "fault") else None


def motion_after(record: SessionRecord, state: str) -> tuple[float, int]:
    """Return how long after the request other motion than the retract ended, and what is amiss.

    Amiss after a stop is motion other than the retract once that has begun; after an estop any
    command beyond the one in flight.
    """
    asked = next(e["t"] for e in record.of_kind("state") if e["data"]["state"] == state)
    rows = record.trajectory
    later: Any = [w for t, w in zip(rows["t"], rows["why"], strict=True) if t > asked]
    times = [t - asked for t in rows["t"] if t > asked]
    if state == "fault":
        return (max(times, default=0.0), max(len(later) - 1, 0))
    other = [k for k, why in enumerate(later) if why != "retract"]
    broken = [k for k in other if "retract" in later[:k]]
    return (max((times[k] for k in other), default=0.0), len(broken))
