"""Event lines: {seq, wall, t, kind, data, previous}, one JSON object a line, seq from 1.

`previous` is the SHA-256 (hex) of the exact bytes of the line before, without its newline; ""
in the first line. The seal that a finished session carries does the same for the last line.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec

from legato.records.errors import RecordError
from legato.records.files import NO_JSON, encode, read_bytes, read_object

EVENTS = "events.jsonl"
EFFECTS = "effects.jsonl"
SESSION = "session.json"


@dataclass(frozen=True)
class ChainReport:
    """Whether a record's lines are as they were written.

    `line` is the first (from 1) that is changed or missing, `text` says what is wrong with it.
    `sealed`: the last line is vouched for too. `torn`: bytes follow that never became a line.
    """

    ok: bool
    lines: int
    line: int | None
    text: str
    torn: bool
    sealed: bool


def digest(line: bytes) -> str:
    """Return what the next line says of this one."""
    return hashlib.sha256(line).hexdigest()


def event_line(
    seq: int, wall: str, t: float, kind: str, data: Mapping[str, Any], previous: str
) -> bytes:
    """Return one event as a line without its newline."""
    return encode(
        {"seq": seq, "wall": wall, "t": t, "kind": kind, "data": data, "previous": previous}
    )


def split_lines(content: bytes) -> tuple[list[bytes], bytes]:
    """Return the complete lines, and the bytes after the last newline."""
    *lines, tail = content.split(b"\n")
    return lines, tail


def decode_line(line: bytes) -> dict[str, Any] | None:
    """Return the event of a line, or None where it is none."""
    try:
        event = msgspec.json.decode(line)
    except NO_JSON:
        return None
    return event if isinstance(event, dict) and {"seq", "kind", "previous"} <= set(event) else None


def read_events(folder: Path) -> tuple[list[dict[str, Any]], bool]:
    """Return a session's events up to the first tear, and whether there is one."""
    try:
        lines, tail = split_lines(read_bytes(folder / EVENTS))
    except FileNotFoundError:
        return [], False
    events: list[dict[str, Any]] = []
    for line in lines:
        event = decode_line(line)
        if event is None:
            return events, True
        events.append(event)
    return events, bool(tail)


def seal_of(lines: list[bytes], tail: bytes = b"") -> dict[str, Any]:
    """Return the seal of a record: its number of lines, the last one's hash, and torn bytes."""
    return {"events": len(lines), "last": digest(lines[-1]) if lines else "", "torn": len(tail)}


def verify_chain(path: Path) -> ChainReport:
    """Say whether a session's event lines are whole; `path` is its folder or its events.jsonl.

    Raises RecordError where the file cannot be read at all.
    """
    folder = path if path.is_dir() else path.parent
    try:
        lines, tail = split_lines(read_bytes(folder / EVENTS))
    except FileNotFoundError as error:
        raise RecordError(f"{folder} has no {EVENTS}", "give a session's folder") from error
    seal = _seal_in(folder)
    broken = _first_break(lines, seal) or _against_seal(lines, tail, seal)
    line, text = broken or (None, "every line is as it was written")
    if not broken and seal is None:
        text = "every line is as it was written; the record has no end that vouches for the last"
    return ChainReport(not broken, len(lines), line, text, bool(tail), seal is not None)


def _seal_in(folder: Path) -> dict[str, Any] | None:
    """Return the seal in session.json, None where there is none yet."""
    try:
        seal = read_object(folder / SESSION).get("seal")
    except FileNotFoundError:
        return None
    return seal if isinstance(seal, dict) else None


def _first_break(lines: list[bytes], seal: dict[str, Any] | None) -> tuple[int, str] | None:
    """Return the number of the first changed or missing line within the chain, and a sentence."""
    hashes = ["", *(digest(line) for line in lines)]
    events = [decode_line(line) for line in lines]
    vouched = {str(after["previous"]) for _, after in pairwise(events) if after is not None}
    if seal is not None:
        vouched.add(str(seal.get("last")))
    for number, event in enumerate(events, start=1):
        if event is None:
            return number, f"line {number} is no event"
        if event["previous"] == hashes[number - 1]:
            if event["seq"] != number:
                return number, f"line {number} is changed: it says that it is {event['seq']}"
            continue
        if event["seq"] != number:
            later = any(e is not None and e["seq"] == number for e in events[number:])
            lost = "out of order" if later else "missing"
            return number, f"line {number} is {lost}: {event['seq']!r} stands in its place"
        # The two lines disagree: the one that a later line vouches for is the sound one.
        sound = hashes[number] in vouched or (number == len(lines) and seal is None)
        at = number - 1 if sound and number > 1 else number
        return at, f"line {at} is changed: its neighbour holds another hash"
    return None


def _against_seal(
    lines: list[bytes], tail: bytes, seal: dict[str, Any] | None
) -> tuple[int, str] | None:
    """Return where a sound chain's end differs from its seal."""
    if seal is None:
        return None
    count = seal.get("events")
    if not isinstance(count, int):
        return max(len(lines), 1), f"nobody knows how many lines there were: {SESSION} is changed"
    if len(lines) < count:
        return len(lines) + 1, f"line {len(lines) + 1} is missing: the record ended with {count}"
    if len(lines) > count:
        return count + 1, f"line {count + 1} was added after the record had ended"
    if any(seal.get(name) != value for name, value in seal_of(lines, tail).items()):
        at = max(count, 1)
        return at, f"line {at} is changed, or what follows it: the record's end has another hash"
    return None
