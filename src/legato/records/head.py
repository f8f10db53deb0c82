"""What vouches for session.json: its seal has its digest, and so has its first `session` line.

The line's digest is of session.json as the session began, the seal's of how it ended. Either is
of the JSON without the seal. A record of an earlier version has neither, and is held to less.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from legato.records.chain import SESSION, digest
from legato.records.files import encode, read_bytes

END: Final = ("ended", "outcome", "reason", "cause")
SEAL: Final = frozenset({"events", "last", "torn", "files", "head"})


def begun_digest(meta: Mapping[str, Any]) -> str:
    """Return the digest of session.json as it was written at the begin."""
    return head_digest(dict(meta) | dict.fromkeys(END))


def head_digest(meta: Mapping[str, Any]) -> str:
    """Return the digest of session.json without its seal."""
    return digest(encode({name: value for name, value in meta.items() if name != "seal"}))


def head_findings(
    path: Path, meta: Mapping[str, Any], events: Sequence[Mapping[str, Any]]
) -> Iterator[str]:
    """Yield where session.json, with `meta` in it, is not what was written. Raises RecordError."""
    lines = [event.get("data") for event in events if event["kind"] == "session"]
    told = [data for data in lines if isinstance(data, dict)]
    first, last = (told[0], told[-1]) if told else ({}, {})
    yield from _against_lines({**meta, "id": path.name}, first, last)
    seal = meta.get("seal")
    if "head" not in first and not (isinstance(seal, dict) and "head" in seal):
        return
    if first.get("head", begun_digest(meta)) != begun_digest(meta):
        yield f"{SESSION} is changed: its first line has another hash"
    if seal is None and any(meta.get(name) is not None for name in END):
        yield f"{SESSION} is changed: it tells of an end and has no seal"
    elif seal is not None and not _seals(seal, meta):
        yield f"{SESSION} is changed: its seal has another hash"
    elif read_bytes(path / SESSION) != encode(meta) + b"\n":
        yield f"{SESSION} is changed: it says the same in other bytes"


def _against_lines(
    meta: Mapping[str, Any], first: Mapping[str, Any], last: Mapping[str, Any]
) -> Iterator[str]:
    """Yield where session.json says another thing than the lines do."""
    for name in ("id", "job"):
        if first.get(name, meta.get(name)) != meta.get(name):
            yield f"{SESSION}: {name} is {meta.get(name)}, its first line says {first[name]}"
    outcome = meta.get("outcome")
    if last.get("outcome") not in (None, outcome):
        yield f"{SESSION}: outcome is {outcome}, its last line says {last['outcome']}"
    elif last.get("outcome") is not None and last.get("reason") != meta.get("reason"):
        yield f"{SESSION}: its reason is not the one that its last line gives"


def _seals(seal: Any, meta: Mapping[str, Any]) -> bool:
    return isinstance(seal, dict) and seal.keys() == SEAL and seal["head"] == head_digest(meta)
