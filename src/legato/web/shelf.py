"""The records as the page reads them: the last picture, the last contacts, reports. Read only.

The daemon's lines carry no pictures: this process stands on the daemon's host and reads its state
folder. Where that cannot be read the page says so and shows the rest.
"""

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from legato.control.band import bands
from legato.records.errors import RecordError
from legato.records.record import SessionRecord
from legato.records.store import Store
from legato.web.picture import view_of
from legato.web.present import Contacts

RECENT = 12  # sessions looked through for a picture or contacts
REPORT_S = 60.0
KEPT = 4  # reports
FINDING = ("run", "calibrate")  # jobs that look for the leg


class NoReport(Exception):
    """A report could not be made."""


@dataclass(frozen=True)
class Seen:
    """What the page shows of one session: its picture, and its contacts."""

    view: dict[str, Any] | None
    contacts: list[dict[str, Any]]
    bands: list[dict[str, Any]] | None
    """By the record's own calibration."""
    finds: bool
    """Whether its job looked for the leg, and found it."""


class Shelf:
    """The sessions under a state folder; any thread may ask, `look` only one."""

    def __init__(self, state_dir: Path) -> None:
        self._store = Store(state_dir)
        self._reports: dict[str, bytes] = {}
        self._ended: dict[str, Seen] = {}
        self._views: dict[tuple[object, ...], dict[str, Any] | None] = {}

    def look(self) -> dict[str, Any]:
        """Return `picture`, the newest view; `solved`, the newest with a calibration; `touched`.

        `touched` are the Contacts of the newest session that touched the leg. Each is None where
        there is none. `solved` and `touched` say `by` which session's pose they are.
        """
        found: dict[str, Any] = dict.fromkeys(("picture", "solved", "touched"))
        for session, seen in self._recent():
            if seen.view is not None:
                found["picture"] = found["picture"] or seen.view
                if found["solved"] is None and seen.view["solved"] is not None:
                    found["solved"] = {**seen.view, "by": None}
            if found["touched"] is None and seen.contacts:
                found["touched"] = Contacts(session, None, seen.bands, seen.contacts)
            if seen.finds:
                _made_by(found, session, seen.bands)
                if None not in found.values():
                    break
        return found

    def frame(self, session: str, name: str) -> bytes:
        """Return a picture's file. Raises RecordError, FileNotFoundError."""
        record = self._store.read(session)
        for path in record.frames:
            if path.name == name:
                return path.read_bytes()
        raise FileNotFoundError(f"session {session} has no picture {name}")

    def report(self, session: str) -> bytes:
        """Return a session's report as HTML, made in a process of its own.

        Raises RecordError where there is no such session, NoReport.
        """
        record = self._store.read(session)
        if session not in self._reports:
            page = drawn(record.path)
            if not record.finished:
                return page
            while len(self._reports) >= KEPT:
                del self._reports[next(iter(self._reports))]
            self._reports[session] = page
        return self._reports[session]

    def _recent(self) -> Iterator[tuple[str, Seen]]:
        """Yield the latest sessions that can be read, newest first."""
        try:
            latest = [summary.id for summary in self._store.sessions()[:RECENT]]
        except RecordError:
            return
        self._ended = {name: seen for name, seen in self._ended.items() if name in latest}
        for session in latest:
            try:
                yield session, self._ended.get(session) or self._read(session)
            except RecordError:
                continue

    def _read(self, session: str) -> Seen:
        """Read a session; what has ended is read once."""
        record = self._store.read(session)
        rows = [dict(event["data"]) for event in record.of_kind("contact")]
        solved = record.calibration
        massage = (record.meta.get("config") or {}).get("massage") or {}
        finds = solved is not None and record.meta.get("job") in FINDING
        own = bands((solved or {}).get("stations") or (), massage.get("contact_window_mm"))
        told = [band.told() for band in own] or None
        seen = Seen(self._view(record), rows, told, finds)
        if record.finished:
            self._ended[session] = seen
        return seen

    def _view(self, record: SessionRecord) -> dict[str, Any] | None:
        """Return a record's view, made anew only where pictures or calibration have changed."""
        solved = record.path / "calibration.json"
        stamp = solved.stat().st_mtime_ns if solved.is_file() else None
        key = (record.id, stamp, *record.frames)
        if key not in self._views:
            self._views = {key: view_of(record)}
        return self._views[key]


def _made_by(found: dict[str, Any], session: str, own: list[dict[str, Any]] | None) -> None:
    """Note that what was found since a session is of the pose that it found."""
    if found["solved"] is not None and found["solved"]["by"] is None:
        found["solved"]["by"] = session
    touched = found["touched"]
    if touched is not None and touched.by is None:
        touched.by, touched.bands = session, touched.bands or own


def drawn(folder: Path) -> bytes:
    """Return the report of a session's folder. Drawing would keep this process from its pages."""
    command = [sys.executable, "-m", "legato.web.draw", str(folder)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=REPORT_S, check=False)
    except subprocess.TimeoutExpired as error:
        raise NoReport(f"the report took longer than {REPORT_S:.0f} s") from error
    if done.returncode:
        last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise NoReport(f"the report could not be made: {''.join(last) or 'no reason given'}")
    return done.stdout
