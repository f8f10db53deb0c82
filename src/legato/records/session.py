"""A session's record while it is written: events, pictures, documents, trajectory, outcome.

Any thread may write; one lock keeps the lines in one order.
"""

import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from legato.records.chain import EFFECTS, EVENTS, SESSION, digest, event_line
from legato.records.errors import RecordError, told
from legato.records.files import LineFile, encode, make_folder, replace_file, sync_folder
from legato.records.head import begun_digest, head_digest
from legato.records.ids import checked_name
from legato.records.trajectory import header_line, row_line

TRAJECTORY = "trajectory.csv"
FRAMES = "frames"


class SessionWriter:
    """Writes the record of one session that has begun; `finish` gives it its outcome and ends it.

    Every method raises RecordError where the disk does not take what is written.
    """

    def __init__(self, path: Path, meta: Mapping[str, Any]) -> None:
        self.path = path
        self.id = path.name
        self._meta = dict(meta)
        self._lock = threading.Lock()
        self._events = LineFile(path / EVENTS)
        self._rows: LineFile | None = None
        self._effects: LineFile | None = None
        self._files: dict[str, str] = {}  # the hash of each whole file, by its place
        self._seq = 0
        self._last = ""
        self._open = True
        self._headed = False  # a line has the digest of session.json
        self._placed = False  # for good: the folder's own entry is on the disk

    def event(
        self, kind: str, data: Mapping[str, Any], *, t: float, wall: str, durable: bool = False
    ) -> int:
        """Append one event and return its number; with `durable` it is on the disk by then.

        `t` is monotonic s, `wall` an ISO time in UTC. The first `session` has `head` besides, what
        session.json is held to.
        """
        with self._lock:
            self._needs_open()
            if heads := kind == "session" and not self._headed:
                data = dict(data) | {"head": begun_digest(self._meta)}
            line = event_line(self._seq + 1, wall, t, kind, data, self._last)
            before = self._seq
            try:
                self._events.append(line, durable=durable)
            finally:
                # A line that stands in the file counts, even where it could not be made durable.
                if self._events.lines > before:
                    self._seq, self._last = before + 1, digest(line)
                    self._headed |= heads
            if durable and not self._placed:
                # After the line: one commit of the file system's journal then serves both.
                with told("write", self.path):
                    sync_folder(self.path.parent)
                self._placed = True
            return self._seq

    def frame(self, name: str, png: bytes) -> str:
        """Keep a picture as frames/`name`.png and return that path within the session."""
        place = f"{FRAMES}/{checked_name(name)}.png"
        with self._lock:
            self._needs_open()
            first = not (self.path / FRAMES).exists()
            make_folder(self.path / FRAMES)
            self._replace(place, png)
            if first:
                with told("write", self.path):
                    sync_folder(self.path)
        return place

    def document(self, name: str, document: Mapping[str, Any]) -> None:
        """Keep a JSON document as `name`.json, replacing an earlier one as a whole."""
        name = checked_name(name.removesuffix(".json"))
        if f"{name}.json" == SESSION:
            raise ValueError("session.json is written by begin and finish alone")
        with self._lock:
            self._needs_open()
            self._replace(f"{name}.json", encode(document) + b"\n")

    def effect(self, line: Mapping[str, Any]) -> None:
        """Append one line of effects.jsonl: what a procedure asked for, and its answer."""
        with self._lock:
            self._needs_open()
            if self._effects is None:
                self._effects = LineFile(self.path / EFFECTS)
            self._effects.append(encode(line))

    def trajectory(self, row: Mapping[str, Any]) -> None:
        """Append one row by column (see `trajectory_row`); columns left out stay empty."""
        line = row_line(row)
        with self._lock:
            self._needs_open()
            if self._rows is None:
                self._rows = LineFile(self.path / TRAJECTORY)
                self._rows.append(header_line())
            self._rows.append(line)

    def finish(
        self, outcome: str, reason: str | None, cause: str | None, ended: str
    ) -> dict[str, Any]:
        """Give the session its outcome, seal its events and close it; returns session.json.

        On RecordError the session stays open, so that finishing may be tried again.
        """
        with self._lock:
            self._needs_open()
            for file in (self._events, self._rows, self._effects):
                if file is not None:
                    file.sync()
            whole = {f.path.name: f.hash for f in (self._rows, self._effects) if f is not None}
            meta = self._meta | {
                "ended": ended,
                "outcome": outcome,
                "reason": reason,
                "cause": cause,
            }
            meta["seal"] = {
                **{"events": self._seq, "last": self._last, "torn": 0},
                **{"files": self._files | whole, "head": head_digest(meta)},
            }
            replace_file(self.path / SESSION, encode(meta) + b"\n")
            self._meta = meta
            self._close()
            return meta

    def close(self) -> None:
        """Let go of the files without an outcome, as a crash would."""
        with self._lock:
            self._close()

    def _close(self) -> None:
        self._open = False
        for file in (self._events, self._rows, self._effects):
            if file is not None:
                file.close()

    def _replace(self, place: str, data: bytes) -> None:
        replace_file(self.path / place, data)
        self._files[place] = digest(data)

    def _needs_open(self) -> None:
        if not self._open:
            raise RecordError(
                f"session {self.id} has ended and takes no more", "begin another session"
            )
