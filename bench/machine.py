"""Clients that do anything at any moment to real daemons whose devices go wrong; see tests.

Half of the daemons carry their arm in their own memory, half drive the emulator's pseudo-terminal,
where the line's own record tells every motion byte. A violation leaves its evidence in
build/machine: the steps, the log's end, the latest records; a seed draws the same steps again.
"""

import secrets
import sys
import tempfile
import time
import traceback
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from bench.row import Row, keep
from tests.system import judge
from tests.system.attacked import SHORT, attacked
from tests.system.emulated import Cell
from tests.system.machine import let_loose
from tests.system.test_survive_line import TABLES
from tests.system.ward import LINE_FAULTS, SIM_FAULTS, Ward

WARDS = 7  # of each kind
EXAMPLES, STEPS = 24, 40
LEAST = 10_000
SCALE = 400.0
EVIDENCE = Path(__file__).resolve().parent.parent / "build" / "machine"


@dataclass
class Found:
    """What one daemon went through."""

    kind: str
    seed: int
    steps: int = 0
    done: Counter[str] = field(default_factory=Counter)
    outcomes: Counter[str] = field(default_factory=Counter)
    causes: Counter[str] = field(default_factory=Counter)
    starts: int = 0
    sessions: int = 0
    motions: int = 0
    slowest_s: float = 0.0
    backs_s: list[float] = field(default_factory=list)
    seconds: float = 0.0
    violation: str | None = None


def run() -> list[Row]:
    """Return how many steps were done, and what was violated."""
    kinds = ["sim", "line"] * WARDS
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(one, kinds, [secrets.randbits(32) for _ in kinds]))
    rows = [*rows_of(found)]
    wrong = [f"{f.kind}, seed {f.seed}: {f.violation}" for f in found if f.violation is not None]
    counts = {
        name: dict(sum((getattr(f, name) for f in found), Counter[str]()).most_common())
        for name in ("done", "outcomes", "causes")
    }
    seeds = [{"kind": f.kind, "seed": f.seed, "steps": f.steps} for f in found]
    keep("machine", rows, violations=wrong, daemons=seeds, **counts)
    return rows


def rows_of(found: list[Found]) -> list[Row]:
    """Return the figures over all daemons."""
    total = sum(f.steps for f in found)
    on_line = sum(f.steps for f in found if f.kind == "line")
    killed = sum(f.done["kill"] for f in found)
    backs = [s for f in found for s in f.backs_s]
    return [
        Row("machine: steps", total, "", LEAST, at_least=True),
        Row("machine: of them over the pseudo-terminal", on_line, ""),
        Row("machine: invariants violated", sum(f.violation is not None for f in found), "", 0),
        Row("machine: sessions, each with one outcome", sum(f.sessions for f in found), ""),
        Row("machine: sessions that a fault has ended",
            sum(f.outcomes["fault"] for f in found), ""),
        Row("machine: kinds of faults met",
            len({c for f in found for c in f.causes} - {"None"}), ""),
        Row("machine: motions on the line", sum(f.motions for f in found), ""),
        Row("machine: kills and other ends in between", sum(f.starts - 1 for f in found), "",
            note=f"{killed} kills"),
        Row("machine: status answered within, worst", max(f.slowest_s for f in found), "s", 5.0),
        Row("machine: back after an end, worst", max(backs, default=0.0), "s"),
        Row("machine: seconds", sum(f.seconds for f in found), "s"),
    ]  # fmt: skip


def one(kind: str, seed: int) -> Found:
    """Let clients loose on one daemon of a kind."""
    found, began = Found(kind, seed), time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        emulator = Cell(folder, *LINE_FAULTS, tables=TABLES) if kind == "line" else None
        tables, sim = (TABLES, {}) if emulator else (SHORT, {"time_scale": SCALE} | FAULTS)
        try:
            with attacked(folder, tables, **sim) as cell:
                ward = Ward(cell, emulator, EVIDENCE / f"{kind}-{seed}")
                try:
                    let_loose(ward, EXAMPLES, STEPS, seed=seed)
                except Exception:  # noqa: BLE001  # it is what the bench is for
                    found.violation = ward.broken or traceback.format_exc()
                    print(found.violation, file=sys.stderr, flush=True)  # noqa: T201 # at once
                take(found, ward)
        finally:
            if emulator is not None:
                emulator.end()
    found.seconds = time.monotonic() - began
    return found


FAULTS = {"faults": SIM_FAULTS}


def take(found: Found, ward: Ward) -> None:
    """Take over what a ward has counted."""
    found.steps, found.done, found.outcomes = ward.steps, ward.done, ward.outcomes
    found.causes, found.slowest_s, found.starts = ward.causes, ward.slowest, ward.cell.starts
    found.backs_s = ward.backs
    found.sessions = len(judge.folders(ward.cell.state_dir))
    if ward.emulator is not None:
        found.motions = len(ward.emulator.motions())
