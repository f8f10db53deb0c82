"""A thousand sessions in one daemon, with faults by lot and resets: nothing grows or is lost."""

import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bench.row import Row, keep
from tests.system import judge
from tests.system.attacked import SHORT, Attacked, attacked
from tests.system.line import Line, ready_to_massage

SESSIONS = 1000
EVERY = 20  # sessions between two looks at memory, files and latencies
WARM = 200  # sessions after which libraries are loaded and rings are full
SCALE = 400.0
CALLS = 20
SLOPE_MB, QUICK_MS = 1.0, 20.0
JOBS = ("massage", "massage", "massage", "home", "home", "capture", "run")
CHANCES = (
    ("arm_lost", 0.0003),
    ("arm_timeout", 0.0003),
    ("arm_refused", 0.0003),
    ("arm_stopped_by_pendant", 0.0003),
    ("following_error", 0.0003),
    ("early_contact", 0.0003),
    ("camera_lost", 0.02),
    ("camera_stale", 0.03),
    ("blank", 0.01),
)
FAULTS = [{"kind": kind, "p": p, "seed": seed} for seed, (kind, p) in enumerate(CHANCES)]


@dataclass
class Looks:
    """What was seen as sessions went by."""

    sessions: list[int] = field(default_factory=list)
    megabytes: list[float] = field(default_factory=list)
    descriptors: list[int] = field(default_factory=list)
    status_ms: list[float] = field(default_factory=list)
    sessions_ms: list[float] = field(default_factory=list)


def run(count: int = SESSIONS) -> list[Row]:
    """Return what has grown over the sessions, and whether their records are whole."""
    looks, outcomes, began = Looks(), Counter[str](), time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "cell"
        tables = SHORT | {"records": {"keep_sessions": 100_000}}
        with attacked(folder, tables, time_scale=SCALE, faults=FAULTS) as cell:
            line = Line(cell.lines["requests"])
            for outcome in sessions(line, np.random.default_rng(1), count):
                outcomes[outcome] += 1
                if outcomes.total() % EVERY == 0:
                    look(looks, outcomes.total(), cell, line)
            line.close()
        wrong = list(judge.records(judge.folders(cell.state_dir)))
        kept = len(judge.folders(cell.state_dir))
        wrong += [str(bug) for bug in cell.logged("bug")] + cell.said()
    rows = [*rows_of(looks, outcomes, kept, wrong)]
    keep("soak", rows, outcomes=dict(outcomes), looks=looks.__dict__, wrong=wrong[:20],
         seconds=time.monotonic() - began)  # fmt: skip
    return rows


def sessions(line: Line, rng: np.random.Generator, count: int) -> Iterator[str]:
    """Yield the outcome of each of so many sessions."""
    done = 0
    while done < count:
        job = str(rng.choice(JOBS))
        before = line.do("sessions", limit=1)["sessions"]
        ready_to_massage(line)
        done += len(new := since(line, before))
        yield from new
        begun = line.ask(job)
        if "result" in begun:
            done += 1
            yield line.outcome(begun["result"]["session"])


def since(line: Line, before: list[dict[str, Any]]) -> list[str]:
    """Return the outcomes of the sessions after the one that was the latest."""
    last = before[0]["id"] if before else None
    found = []
    for told in line.do("sessions", limit=50)["sessions"]:
        if told["id"] == last:
            break
        found.append(str(told["outcome"]))
    return found


def look(looks: Looks, number: int, cell: Attacked, line: Line) -> None:
    """Take down what the daemon holds, and how fast it answers."""
    looks.sessions.append(number)
    looks.megabytes.append(cell.megabytes())
    looks.descriptors.append(cell.descriptors())
    looks.status_ms.append(timed(line, "status"))
    looks.sessions_ms.append(timed(line, "sessions"))


def timed(line: Line, method: str) -> float:
    """Return the median round trip in ms."""
    spent = []
    for _ in range(CALLS):
        began = time.perf_counter()
        line.do(method)
        spent.append(time.perf_counter() - began)
    return float(1e3 * np.median(spent))


def rows_of(
    looks: Looks, outcomes: Counter[str], kept: int, wrong: list[str]
) -> Iterator[Row]:  # fmt: skip
    """Yield the figures."""
    at, held = np.array(looks.sessions), np.array(looks.megabytes)
    late = at > min(WARM, at[-1] // 2)
    slope = 100.0 * float(np.polyfit(at[late], held[late], 1)[0])
    files = [n for n, there in zip(looks.descriptors, late, strict=True) if there]
    yield Row("soak: sessions in one process", outcomes.total(), "", SESSIONS, at_least=True)
    yield Row("soak: of them ended by a fault", outcomes["fault"], "")
    yield Row("soak: memory's slope over 100 sessions", slope, "MB", SLOPE_MB)
    yield Row("soak: memory at the end", float(held[-1]), "MB", peer=float(held[late][0]))
    yield Row("soak: more files open at the end than after the first", files[-1] - files[0], "", 0)
    yield Row("soak: records kept", kept, "", outcomes.total(), at_least=True)
    yield Row("soak: records that are not sound", len(wrong), "", 0)
    yield Row("soak: status at the end", looks.status_ms[-1], "ms", peer=looks.status_ms[0])
    yield Row("soak: slowest status", max(looks.status_ms), "ms", QUICK_MS)
    yield Row("soak: slowest list of sessions", max(looks.sessions_ms), "ms", QUICK_MS)
