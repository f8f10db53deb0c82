"""Replay of one session: the record is the cell, the procedure decides again."""

import platform
from collections.abc import Generator, Iterator, Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from legato import __version__
from legato.control.effects import Effect
from legato.control.jobs import procedure
from legato.control.tape import ended_by
from legato.records.errors import RecordError
from legato.records.record import SessionRecord
from legato.replay.cell import EndOfTape, RecordedCell
from legato.replay.differs import Differs, hold
from legato.replay.start import start_of

# What the worker adds to a document beside the procedure's own words.
ADDED = ("picture", "seconds")


@dataclass(frozen=True)
class Replay:
    """How a replay went: `where` names the first difference, None where there is none."""

    id: str
    same: bool
    effects: int
    end: str
    where: str | None
    recorded: Any
    replayed: Any
    notes: tuple[str, ...]


def replay(record: SessionRecord) -> Replay:
    """Drive the record's procedure again. Raises RecordError where the record lacks what it needs.

    It goes on to the first difference, or to the end of what was recorded.
    """
    start = start_of(record)
    cell = RecordedCell(record, start)
    notes = list(_notes(record))
    end: Mapping[str, Any] = {"end": "broken off", "cause": None, "text": None}
    try:
        work = procedure(start.job, start.settings, start.memory, start.now)
        end = _driven(work, cell)
        _hold_end(record, end, cell)
        _hold_documents(record, cell)
    except Differs as found:
        differs = (found.where, found.recorded, found.replayed)
        return Replay(record.id, False, cell.count, str(end["end"]), *differs, tuple(notes))
    if end["end"] == "broken off":
        notes.append("the record was broken off; up to there it is the same")
    return Replay(record.id, True, cell.count, str(end["end"]), None, None, None, tuple(notes))


def _driven(work: Generator[Effect, Any, str], cell: RecordedCell) -> Mapping[str, Any]:
    """Return how the procedure ended. Raises Differs."""
    try:
        effect = next(work)
        while True:
            try:
                result = cell.perform(effect)
            except (Differs, EndOfTape, RecordError):
                raise
            except Exception as error:  # noqa: BLE001  # whatever it is, the procedure is told
                effect = work.throw(error)
            else:
                effect = work.send(result)
    except StopIteration as stop:
        return {"end": stop.value, "cause": None, "text": None}
    except EndOfTape:
        return {"end": "broken off", "cause": None, "text": None}
    except (Differs, RecordError):
        raise
    except Exception as error:  # noqa: BLE001  # the procedure's own end
        return ended_by(error)
    finally:
        work.close()


def _hold_end(record: SessionRecord, end: Mapping[str, Any], cell: RecordedCell) -> None:
    """Hold the end: the procedure's own, and the session's outcome that follows from it."""
    told = next((line for line in record.effects if "end" in line), None)
    outcome, taken = record.meta.get("outcome"), ("fault", "interrupted", None)
    if told is None or told["end"] == "dropped":
        # The daemon took the job away, or died: the outcome is not the procedure's.
        hold(f"end after effect {cell.count}", "broken off", end["end"])
        if told is None and outcome not in taken:
            raise Differs(f"effects.jsonl, line {cell.count + 1}", None, "another effect")
        if outcome not in taken:
            raise Differs("session.json, outcome", outcome, "fault or interrupted")
        return
    for name in ("end", "cause", "text"):
        hold(f"end after effect {cell.count}, {name}", told.get(name), end.get(name))
    if outcome not in _outcomes(record, str(end["end"])):
        raise Differs("session.json, outcome", outcome, end["end"])
    left = cell.left()
    if left is not None:
        raise Differs(left, "recorded", None)


def _outcomes(record: SessionRecord, end: str) -> set[str | None]:
    """Return the outcomes that a session may have whose procedure ended so."""
    if record.meta.get("outcome") in (None, "interrupted"):
        return {None, "interrupted"}
    faults = {event["data"].get("cause") for event in record.of_kind("fault")}
    if record.meta.get("cause") in faults:
        return {"fault"}  # latched by the daemon, whatever the procedure made of it
    stopped = any(e["data"].get("state") == "stopping" for e in record.of_kind("state"))
    return {end, "stopped"} if stopped and end == "done" else {end}


def _hold_documents(record: SessionRecord, cell: RecordedCell) -> None:
    """Hold each document that the procedure saved, as it was saved last."""
    for name, saved in cell.saved.items():
        recorded = dict(record.document(name.removesuffix(".json")) or {})
        hold(name, _own(recorded), _own(saved))


def _own(document: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in document.items() if name not in ADDED}


def _notes(record: SessionRecord) -> Iterator[str]:
    """Yield what may make a difference and is no fault of the record."""
    now = {
        "legato": __version__,
        "python": platform.python_version(),
        "numpy": metadata.version("numpy"),
        "opencv": metadata.version("opencv-python-headless"),
    }
    then = record.meta.get("versions") or {}
    for name, version in now.items():
        if name in then and then[name] != version:
            yield f"recorded with {name} {then[name]}, replayed with {version}"
