"""The whole job over fifty leg poses: `legato demo --seed N`, each a real daemon of its own."""

import json
import subprocess
import sys
import tempfile
from typing import Any

from bench.row import Row, keep

SEEDS = range(1, 51)
LARGEST_ERROR_MM = 0.8
LEAST_DONE = 48
LONGEST_S = 30.0


def run() -> list[Row]:
    """Return how the runs ended, their worst station and pose, and how long they took."""
    with tempfile.TemporaryDirectory() as folder:
        runs = [demo(seed, folder) for seed in SEEDS]
    done = [r for r in runs if r["outcome"] == "done"]
    errors = [s["error_mm"] for r in done for s in r["stations"]]
    rows = [
        Row("demo: seeds 1 to 50 that end as done", len(done), "", LEAST_DONE, at_least=True),
        Row("demo: runs neither done nor refused", sum(map(_odd, runs)), "", 0),
        Row("demo: worst station error", max(errors), "mm", LARGEST_ERROR_MM),
        Row("demo: station error rms", rms(errors), "mm"),
        Row(
            "demo: worst pose error, translation",
            max(r["pose_error"]["translation_mm"] for r in done),
            "mm",
        ),
        Row(
            "demo: worst pose error, rotation",
            max(r["pose_error"]["rotation_deg"] for r in done),
            "deg",
        ),
        Row("demo: slowest job, wall time", max(r["seconds"] for r in runs), "s", LONGEST_S),
    ]
    refused = {r["seed"]: r["reason"] for r in runs if r["outcome"] != "done"}
    keep("demo", rows, refused=refused)
    return rows


def demo(seed: int, folder: str) -> dict[str, Any]:
    """Return the document of one demo."""
    command = [sys.executable, "-m", "legato", "demo", "--json", "--seed", str(seed)]
    done = subprocess.run([*command, "--out", folder], capture_output=True, text=True, check=False)
    if not done.stdout:
        return {"seed": seed, "outcome": "none", "reason": done.stderr, "seconds": 0.0}
    document: dict[str, Any] = json.loads(done.stdout)
    return document | {"seed": seed}


def rms(values: list[float]) -> float:
    """Return the root mean square."""
    return float((sum(v * v for v in values) / len(values)) ** 0.5)


def _odd(run: dict[str, Any]) -> bool:
    return run["outcome"] not in ("done", "refused")
