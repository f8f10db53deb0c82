"""Every fault on schedule over a real daemon that is told nothing: what it finds, and what it does.

Each run is a whole `run` on the simulated cell with one fault. What truly happened is taken from
the record's truth.json afterwards.
"""

import json
import tempfile
import time
from pathlib import Path
from typing import Any

from bench.process import serving
from bench.row import Row, keep
from legato.daemon.client import Client

SCALE = 100.0
END_S = 120.0
LOST = {"kind": "lost_steps", "call": 150, "motor": 2}

# Name, fault, and the causes of which one must be found; `done` where the cell must go on.
SCHEDULE: tuple[tuple[str, dict[str, Any], tuple[str, ...]], ...] = (
    ("none", {}, ("done",)),
    ("arm_lost", {"kind": "arm_lost", "call": 100}, ("arm_lost",)),
    ("arm_timeout", {"kind": "arm_timeout", "call": 100}, ("arm_timeout",)),
    ("arm_refused", {"kind": "arm_refused", "call": 100}, ("arm_refused",)),
    (
        "arm_stopped_by_pendant",
        {"kind": "arm_stopped_by_pendant", "call": 100},
        ("arm_stopped_by_pendant",),
    ),
    ("arm_blocks, 2 s", {"kind": "arm_blocks", "call": 100, "by": 2.0}, ("done",)),
    ("following_error", {"kind": "following_error", "call": 100}, ("following_error",)),
    ("lost_steps, 60", LOST | {"by": 60.0}, ("contact_early", "contact_late", "leg_moved")),
    ("stuck_closed", {"kind": "stuck_closed", "call": 20}, ("contact_early", "limit")),
    ("stuck_open", {"kind": "stuck_open", "call": 20}, ("contact_late",)),
    ("early_contact, p 0.05", {"kind": "early_contact", "p": 0.05}, ("contact_early",)),
    ("camera_lost, one call", {"kind": "camera_lost", "call": 1}, ("done",)),
    ("camera_lost, 60 s", {"kind": "camera_lost", "call": 2, "for_s": 60.0}, ("camera_lost",)),
    ("camera_stale, 60 s", {"kind": "camera_stale", "call": 1, "for_s": 60.0}, ("camera_stale",)),
    ("blank", {"kind": "blank", "call": 1}, ("marks_not_found",)),
    ("dark", {"kind": "dark", "call": 2}, ("marks_not_found",)),
    ("slow_grab, 5 s", {"kind": "slow_grab", "call": 1, "by": 5.0}, ("done",)),
)  # fmt: skip


def run() -> list[Row]:
    """Return what was found of each fault, and how hard the arm has pressed at most."""
    with tempfile.TemporaryDirectory() as folder:
        found = [session(Path(folder) / str(n), *row) for n, row in enumerate(SCHEDULE)]
    deaf = [f["name"] for f in found if not f["as_designed"]]
    bare = [f["name"] for f in found if f["cause"] and not f["evidence"]]
    moved = [f["name"] for f in found if f["moved_after"]]
    rows = [
        Row("faults: kinds over a real daemon", len(found), ""),
        Row("faults: not found, or found as another", len(deaf), "", 0, note=", ".join(deaf)),
        Row("faults: without state, effects and picture", len(bare), "", 0, note=", ".join(bare)),
        Row("faults: motions after a fault", len(moved), "", 0, note=", ".join(moved)),
        Row("faults: most force at the fingertip", max(f["force_n"] for f in found), "N"),
    ]
    keep("faults", rows, faults=found)
    return rows


def session(
    folder: Path, name: str, fault: dict[str, Any], causes: tuple[str, ...]
) -> dict[str, Any]:
    """Return what a daemon makes of a run with one fault."""
    tables = {"sim": {"time_scale": SCALE, "seed": 1, "faults": [fault] if fault else []}}
    with (
        serving(folder, None, {"robot": "sim", "camera": "sim"}, tables=tables) as ends,
        Client(ends["requests"], ends["events"]) as client,
    ):
        begun = client.call("run")["session"]
        ended = client.call("wait", session=begun, timeout_s=0.0)
        give_up = time.monotonic() + END_S
        while ended["outcome"] is None and time.monotonic() < give_up:
            ended = client.call("wait", session=begun, timeout_s=1.0)
        status = client.call("status")
        before = status["arm"]
        time.sleep(0.3)
        still = client.call("status")["arm"] == before
    record = folder / "state" / "sessions" / begun
    lines = (record / "events.jsonl").read_text(encoding="utf-8").splitlines()
    events = [json.loads(line) for line in lines]
    evidence = next((e["data"]["evidence"] for e in events if e["kind"] == "fault"), {})
    truth = json.loads((record / "truth.json").read_text(encoding="utf-8"))
    cause = (status["fault"] or {}).get("cause")
    return {
        "name": name,
        "fault": fault,
        "outcome": ended["outcome"],
        "cause": cause,
        "as_designed": (cause or ended["outcome"]) in causes,
        "evidence": {"state", "last_effects", "last_bytes", "picture"} <= set(evidence),
        "moved_after": not still,
        "force_n": max((t["force_n"] for t in truth["touches"]), default=0.0),
        "breaches": [b["what"] for b in truth["breaches"]],
        "retries": sum("retry" in e["data"] for e in events),
    }
