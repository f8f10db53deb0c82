"""A daemon killed at random moments of a session and started again at once; what it then says."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from legato.records.record import read_session
from legato.records.whole import verify_record
from tests.system.attacked import Attacked
from tests.system.emulated import HOME, Cell
from tests.system.line import Line, brought_to_idle, ready_to_massage

RETURN_S = 30.0
JOBS = ("run", "run", "massage", "massage", "home")


@dataclass
class Killed:
    """What was found over all kills."""

    kills: int = 0
    torn: int = 0
    states: dict[str, int] = field(default_factory=dict)
    answered_s: list[float] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    motions: int = 0
    """On the emulated arm's line, before the kills."""


@dataclass(frozen=True)
class _Drawn:
    """One kill to come."""

    job: str
    after: float
    looks: bool
    from_state: str


def kill(
    cell: Attacked,
    count: int,
    emulator: Cell | None = None,
    *,
    longest_s: float,
    seed: int = 1,
    jobs: Sequence[str] = JOBS,
    from_state: str = "",
) -> Killed:
    """Kill a daemon `count` times while one of `jobs` runs, `longest_s` after its start at most.

    With `from_state` the time begins with the first state of such a name.
    With an emulator the arm lives on, and what comes on its line is looked at.
    """
    told, rng = Killed(), np.random.default_rng(seed)
    line = Line(cell.lines["requests"])
    try:
        while told.kills < count:
            job, after = str(rng.choice(jobs)), float(rng.uniform(0.0, longest_s))
            looks = bool(rng.integers(2))
            _once(cell, line, emulator, told, _Drawn(job, after, looks, from_state))
    finally:
        line.close()
    return told


def _once(
    cell: Attacked,
    line: Line,
    emulator: Cell | None,
    told: Killed,
    drawn: "_Drawn",
) -> None:
    if drawn.job == "massage":
        ready_to_massage(line, lambda: emulator.truth()["tip"] if emulator else HOME)
    elif not brought_to_idle(line)["arm"]["referenced"]:
        line.do("reference", **(emulator.truth()["tip"] if emulator else HOME))
    session = line.do(drawn.job)["session"]
    while not line.do("status")["state"].startswith(drawn.from_state):
        assert line.do("session", session=session)["outcome"] is None, "it has ended before"
    time.sleep(drawn.after)
    state = line.do("status")["state"] if drawn.looks else "unseen"
    gone_at = cell.kill()
    line.again()
    path = cell.state_dir / "sessions" / session
    orphans = cell.orphans()
    over = (path / "session.json").is_file() and read_session(path).finished
    began = time.monotonic()
    cell.begin()
    told.wrong += [f"orphan {pid}" for pid in orphans]
    status = line.answer(line.send("status"), RETURN_S)["result"]
    told.answered_s.append(time.monotonic() - began)
    told.wrong += _left(path, over, status)
    if emulator is not None:
        time.sleep(0.2)
        motions = [t for t, _ in emulator.motions()]
        late = [t - gone_at for t in motions if t > gone_at + 0.5]
        told.wrong += [f"a motion {t:.3f} s after the kill" for t in late]
        told.motions = sum(t < gone_at for t in motions)
    if not over:
        told.kills += 1
        told.torn += read_session(path).torn
        told.states[state] = told.states.get(state, 0) + 1


def _left(path: Path, over: bool, status: dict[str, object]) -> list[str]:
    """Return what is wrong with the session that was killed, and with the state after it."""
    report, meta = verify_record(path), read_session(path).meta
    wrong = [f"{path.name}: {text}" for text in report.findings]
    fault = status["fault"]
    if over:
        return wrong
    if meta["outcome"] != "interrupted":
        wrong.append(f"{path.name}: outcome {meta['outcome']}")
    if status["state"] != "fault" or not isinstance(fault, dict):
        wrong.append(f"{path.name}: the daemon starts in {status['state']}")
    elif (fault["cause"], fault["session"]) != ("interrupted", path.name):
        wrong.append(f"{path.name}: the fault is {fault}")
    return wrong
