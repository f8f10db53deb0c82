"""The summaries of campaigns on the disk: `state_dir/campaigns/<id>.json`, each replaced whole.

A summary's long parts come last, so that its head is read without them; heads are then kept in
memory, whatever becomes of the files meanwhile. A summary that has no end when a daemon starts was
interrupted; nothing of it goes on.
"""

import secrets
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import Raw

from legato.daemon.log import Log
from legato.records.errors import RecordError, told
from legato.records.files import (
    NO_JSON,
    encode,
    make_folder,
    read_bytes,
    read_object,
    replace_file,
)
from legato.records.ids import checked_id, is_id, session_id

KEPT: Final = 200
LOOKED_AT: Final = 10  # the latest ones, where one without an end is looked for
LONG: Final = ("contacts", "faults", "resets_done", "sessions")  # left out of lists; they come last
START_BYTES: Final = 4096  # more than a head has
# Within a text the quotes would be escaped: these bytes are where the long parts begin.
CUT: Final = b',"' + LONG[0].encode() + b'":'
PLAIN: Final = {"job": "unknown", "key": None, "outcome": None, "reason": None, "ended": None,
                "session": None, "done": 0, "failed": 0}  # fmt: skip

Head = dict[str, Any]


class CampaignFiles:
    """The folder of summaries; `token` gives the part of an id that keeps it unique."""

    def __init__(
        self, state_dir: Path, *, token: Callable[[], str] = lambda: secrets.token_hex(2)
    ) -> None:
        self.folder = state_dir / "campaigns"
        self._token = token
        self._heads: dict[str, Head] | None = None  # the one written last comes last

    def fresh_id(self, started: str) -> str:
        """Return an id that none has, for one that is started at an ISO time."""
        while True:
            name = session_id(started, self._token())
            if not self._path(name).exists():
                return name

    def write(self, name: str, document: Mapping[str, Any]) -> None:
        """Replace a summary, whose long parts come last. Raises RecordError."""
        make_folder(self.folder)
        replace_file(self._path(name), encode(document) + b"\n")
        if self._heads is not None:
            self._heads.pop(name, None)
            self._heads[name] = _short(name, document)

    def remove(self, name: str) -> None:
        """Remove a summary, if it is there. Raises RecordError."""
        path = self._path(checked_id(name))
        with told("remove", path):
            path.unlink(missing_ok=True)
        if self._heads is not None:
            self._heads.pop(name, None)

    def ids(self) -> list[str]:
        """Return all ids, newest first. Raises RecordError.

        Of those of one second the newest is the one that was written last.
        """
        with told("read", self.folder):
            names = self._names()
            together = Counter(map(_second, names))
            found = {name: self._written(name) for name in names if together[_second(name)] > 1}
        return sorted(names, key=lambda n: (_second(n), found.get(n, 0)), reverse=True)

    def read(self, name: str) -> dict[str, Any] | None:
        """Return a summary, None where there is none that can be read."""
        if not is_id(name):
            return None
        with suppress(RecordError, FileNotFoundError):
            return read_object(self._path(name))
        return None

    def shown(self, name: str, most: int) -> dict[str, Any] | None:
        """Return a summary with its latest sessions only, as JSON, None where there is none.

        `left_out` says of how many nothing was read.
        """
        if not is_id(name):
            return None
        with suppress(RecordError, FileNotFoundError, *NO_JSON):
            parts = msgspec.json.decode(read_bytes(self._path(name)), type=dict[str, Raw])
            rows = msgspec.json.decode(parts.get("sessions", b"[]"), type=list[Raw])
            return {**parts, "sessions": rows[-most:], "left_out": max(len(rows) - most, 0)}
        return None

    def heads(self, limit: int | None = None) -> list[Head]:
        """Return the latest summaries without their long parts, newest first. Raises RecordError.

        They are read from the disk once.
        """
        if self._heads is None:
            found = {name: self.head(name) for name in reversed(self.ids())}
            self._heads = {name: head for name, head in found.items() if head is not None}
        newest = list(self._heads.values())[::-1]
        return sorted(newest, key=lambda head: _second(head["id"]), reverse=True)[:limit]

    def head(self, name: str) -> Head | None:
        """Return a summary on the disk without its long parts, None where it cannot be read."""
        with suppress(RecordError, FileNotFoundError, *NO_JSON):
            start, cut, _ = read_bytes(self._path(name), START_BYTES).partition(CUT)
            if cut:
                return _short(name, msgspec.json.decode(start + b"}", type=Head))
        whole = self.read(name)
        return _short(name, whole) if whole is not None else None

    def prune(self) -> None:
        """Remove all but the latest. Raises RecordError."""
        with told("read", self.folder):
            many = len(self._names()) > KEPT
        for name in self.ids()[KEPT:] if many else ():
            self.remove(name)

    def _names(self) -> list[str]:
        """Return all ids, in no order; raises OSError."""
        try:
            names = [path.name for path in self.folder.iterdir()]
        except FileNotFoundError:
            return []
        stems = (name.removesuffix(".json") for name in names if name.endswith(".json"))
        return [stem for stem in stems if is_id(stem)]

    def _written(self, name: str) -> int:
        return self._path(name).stat().st_mtime_ns

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.json"


def close_interrupted(files: CampaignFiles, log: Log) -> None:
    """Give every campaign that has no end the outcome `interrupted`; a disk may refuse that."""
    reason = "the daemon ended while the campaign was under way"
    try:
        for name in files.ids()[:LOOKED_AT]:
            head = files.head(name)
            document = files.read(name) if head is not None and head["ended"] is None else None
            if document is None:
                continue
            closed = document | {"ended": datetime.now(UTC).isoformat(), "outcome": "interrupted"}
            if document.get("session") is not None:
                rows, failed = document.get("sessions"), document.get("failed")
                broken = {"id": document["session"], "outcome": "interrupted", "reason": reason}
                closed["sessions"] = [*(rows if isinstance(rows, list) else ()), broken]
                closed["failed"] = failed + 1 if isinstance(failed, int) else 1
            files.write(name, closed | {"session": None, "reason": reason})
            log.warning("campaign_interrupted", campaign=name)
    except RecordError as error:
        log.error("campaign_not_kept", text=error.text, hint=error.hint)


def _short(name: str, document: Mapping[str, Any]) -> Head:
    """Return a summary without its long parts; what every list shows is there."""
    return {**PLAIN, **{k: v for k, v in document.items() if k not in LONG}, "id": name}


def _second(name: str) -> str:
    return name.partition("-")[0]
