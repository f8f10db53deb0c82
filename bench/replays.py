"""Records of sessions that went every way: each verifies, and replays to the same decisions.

The sessions are those of real daemons on the simulated cell, with faults by lot and with stops,
pauses and emergency stops at random moments.
"""

import random
import tempfile
import time
import tomllib
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

from bench.row import Row, keep
from bench.unattended import configuration
from legato.config.toml import dumps
from legato.daemon.client import Client, RpcError
from legato.records.store import Store
from legato.records.whole import verify_record
from legato.replay.replay import Replay, replay
from tests.system.process import daemon

DAEMONS, SESSIONS = 6, 10
SHORT: dict[str, Any] = {
    "leg": {"stations_mm": [7.0, 67.0]},
    "massage": {"strokes": 1, "dwell_s": 0.5, "draw": {"count": 1}},
    "sim": {"time_scale": 60.0},
}
KINDS = (
    "arm_timeout", "arm_refused", "arm_stopped_by_pendant", "following_error", "early_contact",
    "camera_lost", "blank",
)  # fmt: skip
ACTS = ("", "", "stop", "estop", "pause")


def run() -> list[Row]:
    """Return how many records verified and replayed."""
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        for number in range(DAEMONS):
            sessions(Path(name), number)
        store = Store(Path(name) / "state")
        made = store.sessions()
        sound = [verify_record(store.folder / s.id) for s in made]
        found = [replay(store.read(s.id)) for s in made]
    ends = Counter(f"{s.outcome}{f' {s.cause}' if s.cause else ''}" for s in made)
    note = ", ".join(f"{count} {end}" for end, count in sorted(ends.items()))
    rows = [
        Row("replays: sessions", len(made), "", DAEMONS * SESSIONS, at_least=True, note=note),
        Row("replays: records that do not verify", sum(not r.ok for r in sound), "", 0),
        Row("replays: records that decide otherwise", sum(not r.same for r in found), "", 0,
            note=_first([r for r in found if not r.same])),
        Row("replays: effects", sum(r.effects for r in found), ""),
        Row("replays: time in all", time.monotonic() - began, "s"),
    ]  # fmt: skip
    keep("replays", rows, ends=dict(ends))
    return rows


def sessions(folder: Path, number: int) -> None:
    """Run sessions in one daemon; every other daemon is killed within its last one."""
    draws = random.Random(number)
    file = configuration(folder)
    data = _changed(file, draws)
    file.write_text(dumps(data, "Made by a bench."), encoding="utf-8")
    with daemon(file) as running, Client(running.requests) as client:
        for session in range(SESSIONS):
            if client.call("status")["state"] == "fault":
                client.call("reset")
            if not client.call("status")["arm"]["referenced"]:
                client.call("reference", xyz_mm=[127.0, 0.0, 150.0])
            job = draws.choice(("run", "run", "massage"))
            try:
                id_ = client.call(job)["session"]
            except RpcError:
                id_ = client.call("run")["session"]
            if number % 2 and session == SESSIONS - 1:
                time.sleep(draws.uniform(0.1, 2.0))
                running.process.kill()
                running.process.wait()
                break
            act(client, draws)
            while client.call("wait", session=id_, timeout_s=3)["outcome"] is None:
                pass
    with daemon(file):
        pass  # closes what the one before has left


def act(client: Client, draws: random.Random) -> None:
    """Stop, pause or do nothing, at a random moment."""
    what = draws.choice(ACTS)
    if not what:
        return
    time.sleep(draws.uniform(0.0, 2.5))
    with suppress(RpcError):  # it does not fit the state any more: the session goes on as it is
        client.call(what)
        if what == "pause":
            time.sleep(draws.uniform(0.0, 0.5))
            client.call("resume" if draws.random() < 0.5 else "stop")
    if client.call("status")["state"] == "paused":
        client.call("stop")


def _changed(file: Path, draws: random.Random) -> dict[str, Any]:
    """Return a configuration with other seeds, and faults by lot."""
    data = tomllib.loads(file.read_text(encoding="utf-8"))
    for table, keys in SHORT.items():
        data[table] = data.get(table, {}) | keys
    data["sim"]["seed"] = draws.randrange(1, 1000)
    data["sim"]["faults"] = [
        {"kind": kind, "p": 0.15 if kind in ("camera_lost", "blank") else 0.001,
         "seed": draws.randrange(1000)}
        for kind in KINDS
    ]  # fmt: skip
    return data


def _first(found: list[Replay]) -> str:
    return f"{found[0].id}: {found[0].where}" if found else ""
