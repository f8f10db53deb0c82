"""Whether a record is as it was written: its chain of events, its files, its head.

The seal of a finished session has the hash of every file that belongs to it. A session that never
ended has no seal: then only what its own lines name can be missed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from legato.records.chain import EFFECTS, SESSION, ChainReport, digest, verify_chain
from legato.records.errors import RecordError
from legato.records.files import read_bytes
from legato.records.record import SessionRecord, read_session
from legato.records.session import FRAMES, TRAJECTORY


@dataclass(frozen=True)
class RecordReport:
    """What was found: `findings` has a sentence for each fault, the first of them first."""

    id: str
    ok: bool
    findings: tuple[str, ...]
    notes: tuple[str, ...]
    chain: ChainReport | None


def verify_record(path: Path) -> RecordReport:
    """Hold a session's folder to its chain and its seal; a record that is damaged is a finding."""
    try:
        record = read_session(path)
        chain = verify_chain(path)
    except RecordError as error:
        return RecordReport(path.name, False, (error.text,), (), None)
    broken = [] if chain.ok else [f"events.jsonl: {chain.text}"]
    findings = (*broken, *_files(record), *_head(record))
    return RecordReport(path.name, not findings, findings, tuple(_notes(record, chain)), chain)


def file_hashes(path: Path) -> dict[str, str]:
    """Return the hash of every file of a session that its seal vouches for beside the events."""
    found = [*path.glob("*.json"), *path.glob(f"{FRAMES}/*.png")]
    found += [path / name for name in (TRAJECTORY, EFFECTS)]
    places = sorted(f for f in found if f.is_file() and not f.is_symlink() and f.name != SESSION)
    return {str(f.relative_to(path)): digest(read_bytes(f)) for f in places}


def _files(record: SessionRecord) -> Iterator[str]:
    """Yield what is wrong with the files that the seal, or a document, names."""
    sealed = _sealed_files(record)
    for place, written in sorted(sealed.items()):
        try:
            now = digest(read_bytes(record.path / place))
        except FileNotFoundError:
            yield f"{place} is missing"
        except RecordError as error:
            yield error.text
        else:
            if now != written:
                yield f"{place} is changed"
    picture = (record.calibration or {}).get("picture")
    if picture is not None and picture not in sealed and not (record.path / picture).is_file():
        yield f"{picture} is missing, which calibration.json names"


def _head(record: SessionRecord) -> Iterator[str]:
    """Yield where session.json says another thing than the lines do."""
    told = [event["data"] for event in record.of_kind("session")]
    first, last = (told[0], told[-1]) if told else ({}, {})
    for name, wanted in (("id", record.id), ("job", record.meta.get("job"))):
        if first.get(name, wanted) != wanted:
            yield f"session.json: {name} is {wanted}, its first line says {first[name]}"
    outcome = record.meta.get("outcome")
    if last.get("outcome") not in (None, outcome):
        yield f"session.json: outcome is {outcome}, its last line says {last['outcome']}"


def _notes(record: SessionRecord, chain: ChainReport) -> Iterator[str]:
    """Yield what is no fault but should be known."""
    if chain.torn or record.torn:
        yield f"torn: bytes follow line {chain.lines} that never became a line"
    if not record.finished:
        yield "it has not ended: nothing vouches for its last line and its files"
    elif not _sealed_files(record):
        yield "its files are not sealed"


def _sealed_files(record: SessionRecord) -> dict[str, str]:
    seal: Any = record.meta.get("seal")
    files = seal.get("files") if isinstance(seal, dict) else None
    if not isinstance(files, dict):
        return {}
    return {str(place): str(value) for place, value in files.items()}
