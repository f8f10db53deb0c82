"""Whether a record is as it was written: its chain of events, its files, its head.

The seal of a finished session has the hash of every file that belongs to it; only reports are
made later. A session that never ended has no seal: then only what its own lines name can be missed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from legato.records.chain import EVENTS, SESSION, ChainReport, digest, verify_chain
from legato.records.errors import RecordError
from legato.records.files import read_bytes
from legato.records.head import head_findings
from legato.records.record import SessionRecord, read_session

LATER: Final = ("report.html", "report.pdf")  # made of the record, by default into its folder
OPEN: Final = (SESSION, f".{SESSION}.tmp", EVENTS)  # what a seal says of these it says otherwise


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
        head = list(head_findings(path, record.meta, record.events))
    except RecordError as error:
        return RecordReport(path.name, False, (error.text,), (), None)
    except RecursionError:
        return RecordReport(path.name, False, (f"{SESSION} is nested too deep",), (), None)
    broken = [] if chain.ok else [f"events.jsonl: {chain.text}"]
    findings = (*broken, *_files(record), *head)
    return RecordReport(path.name, not findings, findings, tuple(_notes(record, chain)), chain)


def file_hashes(path: Path) -> dict[str, str]:
    """Return the hash of every file of a session that its seal vouches for beside the events."""
    places = [place for place in _places(path) if not (path / place).is_symlink()]
    return {place: digest(read_bytes(path / place)) for place in places}


def _places(path: Path) -> list[str]:
    """Return what a seal has to name: all but folders, what is open until then, and reports."""
    found = [f for f in path.rglob("*") if f.is_symlink() or not f.is_dir()]
    places = sorted(f.relative_to(path).as_posix() for f in found)
    return [place for place in places if place not in (*OPEN, *LATER)]


def _files(record: SessionRecord) -> Iterator[str]:
    """Yield what is wrong with the files that the seal, or a document, names."""
    sealed = _sealed_files(record)
    for place, written in sorted(sealed.items()):
        try:
            now = digest(read_bytes(record.path / place))
        except FileNotFoundError:
            yield f"{place} is missing"
        except (RecordError, ValueError) as error:  # ValueError: no file has such a name
            yield error.text if isinstance(error, RecordError) else f"{place!r}: {error}"
        else:
            if now != written:
                yield f"{place} is changed"
    if "head" in _seal(record):
        added = set(_places(record.path)) - set(sealed)
        yield from (f"{place} was added after the record had ended" for place in sorted(added))
    picture = (record.calibration or {}).get("picture")
    if isinstance(picture, str) and picture not in sealed and not (record.path / picture).is_file():
        yield f"{picture} is missing, which calibration.json names"


def _notes(record: SessionRecord, chain: ChainReport) -> Iterator[str]:
    """Yield what is no fault but should be known."""
    if chain.torn or record.torn:
        yield f"torn: bytes follow line {chain.lines} that never became a line"
    if not record.finished:
        yield "it has not ended: nothing vouches for its last line and its files"
    elif not _sealed_files(record):
        yield "its files are not sealed"


def _sealed_files(record: SessionRecord) -> dict[str, str]:
    files = _seal(record).get("files")
    if not isinstance(files, dict):
        return {}
    return {str(place): str(value) for place, value in files.items()}


def _seal(record: SessionRecord) -> dict[str, Any]:
    seal = record.meta.get("seal")
    return seal if isinstance(seal, dict) else {}
