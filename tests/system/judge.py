"""Whether what is left of a daemon's life is sound: records, outcomes, states, bytes on the line.

Every function returns sentences, none where all is well.
"""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

from legato.control.states import deadline, moves, rows
from legato.records.record import SessionRecord, read_session
from legato.records.whole import verify_record

SLACK_S = 2.0  # for a machine that is busy with something else, beyond a state's deadline
IN_FLIGHT_S = 0.5  # a motion lasts 0.2 s at most, the rest is the emulator's own stamp


def folders(state_dir: Path) -> list[Path]:
    """Return the folders of all sessions, oldest first."""
    return sorted(p for p in (state_dir / "sessions").glob("*") if p.is_dir() and p.name[0] != ".")


def records(paths: Iterable[Path], *, wall: bool = True) -> Iterator[str]:
    """Yield what is wrong with sessions: chain, files, number of outcomes, states, motions.

    Without `wall` its clock was changed meanwhile, and says nothing of how long a state lasted.
    """
    for path in paths:
        report = verify_record(path)
        yield from (f"{path.name}: {text}" for text in report.findings)
        record = read_session(path)
        yield from (f"{path.name}: {text}" for text in one(record, wall=wall))


def one(record: SessionRecord, *, wall: bool = True) -> Iterator[str]:
    """Yield what is wrong with one session that is over."""
    outcome = record.meta.get("outcome")
    ends = [e["data"]["outcome"] for e in record.of_kind("session") if e["data"]["outcome"]]
    if outcome is None:
        yield "it has no outcome"
    elif outcome == "interrupted":
        if len(ends) > 1:
            yield f"it ended {len(ends)} times"
    elif ends != [outcome] and (ends or record.meta.get("cause") != "disk"):
        yield f"its lines end it as {ends}, session.json as {outcome}"
    if wall:
        yield from lasted(record)
    yield from moved_in_place(record)


def lasted(record: SessionRecord) -> Iterator[str]:
    """Yield states that lasted longer than they may."""
    states = [(e["data"]["state"], datetime.fromisoformat(e["wall"])) for e in stated(record)]
    for (state, since), (_, until) in pairwise(states):
        limit, lasting = deadline(state), (until - since).total_seconds()
        if limit is not None and lasting > limit + SLACK_S:
            yield f"{state} lasted {lasting:.1f} s, {limit:g} s are allowed"


def moved_in_place(record: SessionRecord) -> Iterator[str]:
    """Yield motions outside a motion state, but for one that was on its way when it was left."""
    states = [(float(e["t"]), str(e["data"]["state"])) for e in stated(record)]
    columns = record.trajectory
    ends = [float(t) for t, why in zip(columns["t"], columns["why"], strict=True) if why]
    yield from out_of_place(ends, states, float("inf"))


def stated(record: SessionRecord) -> Sequence[Mapping[str, Any]]:
    """Return the record's changes of state."""
    return record.of_kind("state")


def out_of_place(
    motions: Iterable[float], states: Sequence[tuple[float, str]], late_s: float
) -> Iterator[str]:
    """Yield motions at times when the state has none; one may follow within `late_s`."""
    strays: dict[int, int] = {}
    times = [since for since, _ in states]
    for t in motions:
        at = bisect_right(times, t) - 1
        state = states[at][1] if at >= 0 else "none yet"
        if at >= 0 and moves(state):
            continue
        strays[at] = strays.get(at, 0) + 1
        left = at > 0 and moves(states[at - 1][1])
        if not left or strays[at] > 1 or t - states[at][0] > late_s:
            yield f"a motion at {t:.3f} in {state}"


def on_the_line(
    motions: Iterable[float], paths: Iterable[Path], kills: Sequence[float] = ()
) -> Iterator[str]:
    """Yield motion commands on the line outside every session's motion states.

    Times are the system's monotonic s, in the records too; at `kills` a session ended unwritten.
    """
    states: list[tuple[float, str]] = []
    for path in paths:
        record = read_session(path)
        own = [(float(e["t"]), str(e["data"]["state"])) for e in stated(record)]
        cut = min((k for k in kills if own and k > own[-1][0]), default=None)
        if record.meta.get("outcome") == "interrupted" and cut is not None:
            own.append((cut, "killed"))
        states += own
    yield from out_of_place(motions, sorted(states), IN_FLIGHT_S)


def chained(lines: Iterable[Mapping[str, Any]], stations: Sequence[float]) -> Iterator[str]:
    """Yield changes of state, as one daemon logged them, that the table does not have."""
    table, last = set(rows(stations)), None
    for line in lines:
        before, after = line["previous"], line["state"]
        if last not in (None, before):
            yield f"{after} says that it follows {before}, it was {last}"
        if (before, after) not in table:
            yield f"there is no way from {before} to {after}"
        if before == "fault" and line["cause"] != "reset":
            yield f"fault was left by {line['cause']}"
        last = after
