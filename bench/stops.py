"""Stops and emergency stops at random moments, in true time, judged from the bytes on the line.

Several cells side by side, each a real daemon with the TeachMover's driver on the emulator's
pseudo-terminal at 9600 baud. Moments are the system's monotonic seconds: the client's when it asks,
the emulator's when a command has come in. The record says what each motion was for.
"""

import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bench.row import Row, keep
from legato.cli.child import Child
from legato.daemon.client import Client
from tests.system.emulated import HOME, Cell, ended, outcome

CELLS = 8
STOPS, ESTOPS = 26, 7  # of each cell; a few massages end before
OTHERS = 2  # stops of each cell in each of OTHER_STATES
OTHER_STATES = ("verify", "move_home", "paused")
WAITS_S = (0.0, 26.0)  # a massage with these strokes lasts a little longer
TABLES: dict[str, dict[str, Any]] = {
    "massage": {"strokes": 1, "dwell_s": 0.3, "draw": {"count": 1, "dwell_s": 0.2}},
    "calibration": {"fresh_s": 86400.0},  # one calibration serves them all
}
LIMIT_S = 0.25


@dataclass
class Broken:
    """One job that was broken off: how, in which state, and when that was asked for and heard."""

    how: str
    state: str
    session: str
    outcome: str
    asked: float
    commanded: float
    confirmed: float | None
    motions: list[tuple[float, str]] = field(default_factory=list)
    """When the job's motions were sent, and what each was for."""
    ends: list[float] = field(default_factory=list)
    """When each had been answered."""

    def later(self) -> list[tuple[float, str]]:
        """Return the motions that were sent after it was asked for: how much later, what for."""
        return [(t - self.asked, why) for t, why in self.motions if t > self.asked]

    def others(self) -> list[float]:
        """Return how much later motions other than the retract were sent."""
        return [t for t, why in self.later() if why != "retract"]

    def ended(self) -> float:
        """Return how much later the last motion that is no retract was over, at least 0."""
        both = zip(self.motions, self.ends, strict=True)
        return max([e - self.asked for (_, why), e in both if why != "retract"] + [0.0])

    def after_retract(self) -> int:
        """Return how many motions other than the retract came once that had begun."""
        whys = [why for _, why in self.later()]
        begun = whys.index("retract") if "retract" in whys else len(whys)
        return sum(why != "retract" for why in whys[begun:])

    def after_command(self) -> int:
        """Return how many motions were sent once the daemon had closed the gate."""
        return sum(t > self.commanded for t, _ in self.motions)


def run() -> list[Row]:
    """Return how long motion goes on after a stop and after an estop, and what follows it."""
    with ThreadPoolExecutor(CELLS) as pool:
        broken = [b for of_cell in pool.map(one_cell, range(CELLS)) for b in of_cell]
    stops = [b for b in broken if b.how == "stop" and b.state.startswith("massage")]
    estops = [b for b in broken if b.how == "estop"]
    others = [b for b in broken if b.how == "stop" and b not in stops]
    rows = [*of_stops(stops), *of_estops(estops), *of_others(others)]
    counts = {s: sum(b.state == s for b in stops) for s in sorted({b.state for b in stops})}
    flights = {w: sum(in_flight(b) == w for b in stops) for w in {in_flight(b) for b in stops}}
    keep("stops", rows, cells=CELLS, time_scale=1.0, states=counts, in_flight=flights)
    return rows


def of_stops(stops: list[Broken]) -> Iterator[Row]:
    """Yield the figures of stops in the middle of a pass."""
    later = [max(b.others(), default=0.0) for b in stops]
    ends = [b.ended() for b in stops]
    known = [b.confirmed - b.asked for b in stops if b.confirmed is not None]
    yield Row("stops: in the middle of a pass", len(stops), "", 200, at_least=True)
    yield Row("stops: not ended as stopped", sum(b.outcome != "stopped" for b in stops), "", 0)
    yield Row("stops: other motion sent after the request, worst", max(later), "s", LIMIT_S)
    yield Row("stops: other motion over after the request, worst", max(ends), "s", LIMIT_S)
    yield Row("stops: other motion over after the request, median", float(np.median(ends)), "s")
    broken = sum(b.after_retract() for b in stops)
    yield Row("stops: motions other than the retract once it began", broken, "", 0)
    yield Row("stops: confirmed", len(known), "", len(stops), at_least=True)
    yield Row("stops: confirmed after the request, worst", max(known), "s")


def of_estops(estops: list[Broken]) -> Iterator[Row]:
    """Yield the figures of emergency stops."""
    yield Row("stops: estops in a pass", len(estops), "", 50, at_least=True)
    ends = [max([e - b.asked for e in b.ends] + [0.0]) for b in estops]
    after = sum(b.after_command() for b in estops)
    yield Row("stops: estops, any motion over after the request, worst", max(ends), "s", LIMIT_S)
    yield Row("stops: estops, commands after the one in flight", after, "", 0)
    yield Row("stops: estops that are no fault", sum(b.outcome != "fault" for b in estops), "", 0)


def of_others(others: list[Broken]) -> Iterator[Row]:
    """Yield the figures of stops in other states than a pass."""
    for state in OTHER_STATES:
        here = [b for b in others if b.state == state]
        late = max((t for b in here for t, _ in b.later()), default=0.0)
        yield Row(f"stops: in {state}", len(here), "", CELLS, at_least=True)
        yield Row(f"stops: in {state}, motion sent after the request", late, "s", LIMIT_S)


def in_flight(broken: Broken) -> str:
    """Return what the motion was for that was under way at the request."""
    before = [why for t, why in broken.motions if t <= broken.asked]
    return before[-1] if before else "none"


def one_cell(number: int) -> list[Broken]:
    """Break off one cell's jobs again and again; return what came on its line."""
    rng = np.random.default_rng(number)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cell = Cell(folder, scale=1.0, tables=TABLES, seed=number)
        child = Child(cell.config, folder / "daemon.log")
        try:
            child.ready()
            (ready,) = (line for line in child.lines() if line.get("event") == "ready")
            with Client(str(ready["requests"])) as client, Client(str(ready["stop"])) as line:
                client.call("reference", **HOME)
                for job in ("capture", "calibrate", "verify"):
                    assert ended(client, job)["outcome"] == "done"
                broken = list(breaking(client, line, rng))
                child.end(client)
        finally:
            child.end(None)
            assert cell.end() == 0
        return judged(cell, broken)


def breaking(client: Client, line: Client, rng: np.random.Generator) -> Iterator[Broken]:
    """Break off massages, and other states in between, in random order."""
    kinds = ["stop"] * STOPS + ["estop"] * ESTOPS + [*OTHER_STATES] * OTHERS
    for kind in rng.permutation(kinds):
        yield from one(client, line, str(kind), rng)


def one(client: Client, line: Client, kind: str, rng: np.random.Generator) -> Iterator[Broken]:
    """Break off one job; yields nothing where it had ended before."""
    job = {"verify": "verify", "move_home": "home"}.get(kind, "massage")
    session = str(client.call(job)["session"])
    longest = {"verify": 0.05, "move_home": 0.5}.get(kind, WAITS_S[1])
    time.sleep(float(rng.uniform(WAITS_S[0], longest)))
    if kind == "paused":
        client.call("pause")
        while client.call("status")["state"] not in ("paused", "idle"):
            time.sleep(0.05)
    state = client.call("status")["state"]
    asked = time.monotonic()
    told = line.call("estop" if kind == "estop" else "stop", timeout_s=5.0)
    end = outcome(client, session)["outcome"]
    if kind == "estop":
        client.call("reset")
    if kind == "verify" and not client.call("status")["calibration"]["valid"]:
        for again in ("capture", "calibrate", "verify"):
            ended(client, again)
    if end != "done":
        how = "estop" if kind == "estop" else "stop"
        yield Broken(how, state, session, end, asked, told["commanded"], told["confirmed"])


def judged(cell: Cell, broken: list[Broken]) -> list[Broken]:
    """Give each broken-off job its motions on the line, by the record of what each was for."""
    passed = cell.passed()
    sent = [k for k, (_, way, data) in enumerate(passed) if way == ">" and b"@STEP" in data]
    answered = [next(t for t, way, _ in passed[k:] if way == "<") for k in sent]
    by_session = {b.session: b for b in broken}
    done = 0
    records = [cell.record(f.name) for f in (cell.folder / "state" / "sessions").iterdir()]
    for record in sorted(records, key=lambda r: str(r.meta["started"])):
        whys = [str(w) for w in record.trajectory["why"] if w]
        mine = slice(done, done + len(whys))
        if record.id in by_session:
            times = [passed[k][0] for k in sent[mine]]
            by_session[record.id].motions = list(zip(times, whys, strict=True))
            by_session[record.id].ends = answered[mine]
        done += len(whys)
    assert done == len(sent), f"{len(sent)} motions on the line, {done} in the records"
    return broken
