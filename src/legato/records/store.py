"""The folder of all sessions and the daemon's own state, under `records.state_dir`.

One process writes. A session's folder appears whole, with its session.json, or not at all.
"""

import os
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from errno import EEXIST, ENOTEMPTY
from pathlib import Path
from typing import Any

from legato.records.chain import EVENTS, SESSION, read_events, seal_of, split_lines
from legato.records.errors import RecordError, told
from legato.records.files import (
    encode,
    make_folder,
    new_file,
    read_bytes,
    read_object,
    remove_folder,
    replace_file,
)
from legato.records.head import head_digest
from legato.records.ids import began, checked_id, is_id, moment, session_id
from legato.records.record import SessionRecord, read_session
from legato.records.session import SessionWriter
from legato.records.whole import file_hashes

BEGUN = ".begun-"
PRUNED = ".pruned-"
DAY = timedelta(days=1)


@dataclass(frozen=True)
class Summary:
    """One line of a list of sessions; times are ISO text, `outcome` is None until it has one."""

    id: str
    job: str
    started: str
    ended: str | None
    outcome: str | None
    reason: str | None
    cause: str | None
    simulated: bool
    key: str | None = None


class Store:
    """The records under one folder; `token` gives the part of an id that keeps it unique."""

    def __init__(
        self, state_dir: Path, *, token: Callable[[], str] = lambda: secrets.token_hex(2)
    ) -> None:
        self.state_dir = state_dir
        self.folder = state_dir / "sessions"
        self._token = token

    def begin(self, meta: Mapping[str, Any]) -> SessionWriter:
        """Begin a session's record; `meta` is session.json's content, with `started` in ISO.

        Its first durable event makes sure that it outlasts a power cut. Raises RecordError where
        the disk does not take it: then there is no session.
        """
        make_folder(self.folder)
        for _ in range(64):
            name = session_id(str(meta["started"]), self._token())
            whole = {"id": name} | dict(meta) | {"id": name}
            whole |= {"ended": None, "outcome": None, "reason": None, "cause": None}
            if self._place(name, whole):
                return SessionWriter(self.folder / name, whole)
        raise RecordError(f"{self.folder} has no free id left", "begin again in a second")

    def _place(self, name: str, meta: Mapping[str, Any]) -> bool:
        """Put a new session's folder in place as a whole; False where the id is taken."""
        fresh, final = self.folder / f"{BEGUN}{name}", self.folder / name
        if fresh.exists():
            remove_folder(fresh)
        make_folder(fresh)
        with told("begin a session in", self.folder):
            try:
                (fresh / EVENTS).touch(mode=0o640)
                new_file(fresh / SESSION, encode(meta) + b"\n")
                fresh.rename(final)
            except OSError as error:
                if error.errno not in (EEXIST, ENOTEMPTY):
                    raise
                remove_folder(fresh)
                return False
        return True

    def read(self, session: str) -> SessionRecord:
        """Return one session's record; raises RecordError where there is none."""
        return read_session(self._path(session))

    def sessions(self, newest: int | None = None) -> list[Summary]:
        """Return every session, newest first; with `newest` only so many are read."""
        paths = sorted(self._paths(), reverse=True)[:newest]
        found = [self._summary(path) for path in paths]
        return sorted(found, key=lambda s: (s.started, s.id), reverse=True)

    def unfinished(self) -> list[str]:
        """Return the ids of sessions without an outcome, oldest first."""
        return [s.id for s in reversed(self.sessions()) if s.outcome is None]

    def close_interrupted(self, session: str, ended: str | None = None) -> None:
        """Give a session that has none the outcome `interrupted`; its lines stay untouched.

        It ended at `ended`, or when its last event was written, as far as anybody knows.
        """
        path = self._path(session)
        meta = self._meta_or_rest(path)
        if meta.get("outcome") is not None:
            return
        events, torn = read_events(path)
        last = str(events[-1].get("wall")) if events else str(meta.get("started"))
        reason = "the daemon ended before the session did"
        if torn:
            reason += f"; its record is torn after event {len(events)}"
        meta |= {
            "ended": ended or last,
            "outcome": "interrupted",
            "reason": reason,
            "cause": "interrupted",
        }
        meta["seal"] = _seal(path) | {"files": file_hashes(path), "head": head_digest(meta)}
        replace_file(path / SESSION, encode(meta) + b"\n")

    def sweep(self, left: tuple[str, ...] = (BEGUN, PRUNED)) -> None:
        """Remove what an interrupted begin or prune left; only while no session can begin."""
        with told("read", self.folder):
            entries = list(os.scandir(self.folder)) if self.folder.is_dir() else []
        stuck: list[RecordError] = []
        for entry in entries:
            if entry.name.startswith(left) and entry.is_dir(follow_symlinks=False):
                with _noted(stuck):
                    remove_folder(Path(entry.path))
        if stuck:
            raise stuck[0]

    def prune(
        self, keep_days: float, now: datetime, *, min_free_mb: float = 0.0, keep_newest: int = 0
    ) -> list[str]:
        """Remove finished sessions that are too old or in the way; return their ids.

        Too old: ended more than `keep_days` before `now`. In the way: the oldest, as long as less
        than `min_free_mb` is free. A session without an outcome stays, and so do the `keep_newest`
        latest, whatever the clock says, and all that ended within a day. Raises RecordError once
        all is done that could be.
        """
        removed: list[str] = []
        stuck: list[RecordError] = []
        with _noted(stuck):
            self.sweep((PRUNED,))
        too_old, a_day_old = now - timedelta(days=keep_days), now - DAY
        short: bool | None = None  # unknown as long as nobody needs to know
        for path in sorted(self._paths(), reverse=True)[keep_newest:][::-1]:
            # None ends before it begins: what is too young by its name is not even read.
            begun = began(path.name)
            if begun >= a_day_old:
                break
            if begun >= too_old:
                short = self.free_mb() < min_free_mb if short is None else short
                if not short:
                    break
            summary = self._summary(path)
            if summary.outcome is None or not _older(summary, a_day_old):
                continue
            if short or _older(summary, too_old):
                with _noted(stuck):
                    self._remove(summary.id)
                    removed.append(summary.id)
                short = None
        if stuck:
            others = f"; {len(removed)} others are removed" if removed else ""
            raise RecordError(stuck[0].text + others, stuck[0].hint)
        return removed

    def _remove(self, session: str) -> None:
        """Remove a session's folder; what a crash leaves of it is no session any more."""
        path, gone = self.folder / session, self.folder / f"{PRUNED}{session}"
        with told("remove", path):
            path.rename(gone)
        remove_folder(gone)

    def load_state(self) -> dict[str, Any]:
        """Return what `save_state` kept last, empty where it never did."""
        try:
            return read_object(self.state_dir / "state.json")
        except FileNotFoundError:
            return {}

    def save_state(self, state: Mapping[str, Any]) -> None:
        """Keep the daemon's own state, replacing the last as a whole."""
        make_folder(self.state_dir)
        replace_file(self.state_dir / "state.json", encode(state) + b"\n")

    def free_mb(self) -> float:
        """Return the megabytes that may still be written under the state folder."""
        place = self.state_dir
        with told("look at", place):
            while not place.exists() and place != place.parent:
                place = place.parent
            return shutil.disk_usage(place).free / 1e6

    def _path(self, session: str) -> Path:
        """Return the folder of a session that is there."""
        path = self.folder / checked_id(session)
        if path.is_symlink() or not path.is_dir():
            raise RecordError(f"there is no session {session}", "`legato sessions` lists them")
        return path

    def _paths(self) -> Iterator[Path]:
        """Yield the folders of all sessions; links and foreign names are none."""
        with told("read", self.folder):
            try:
                entries = list(os.scandir(self.folder))
            except FileNotFoundError:
                return
        for entry in entries:
            if is_id(entry.name) and entry.is_dir(follow_symlinks=False):
                yield Path(entry.path)

    def _summary(self, path: Path) -> Summary:
        """Return one session's line; a damaged session.json leaves it without an outcome."""
        meta = {"reason": "session.json is damaged", **_stand_in(path)}
        with suppress(RecordError, FileNotFoundError):
            meta = read_object(path / SESSION)
        return Summary(
            id=path.name,
            job=_text(meta.get("job", "unknown")) or "",
            started=_text(meta.get("started")) or "",
            ended=_text(meta.get("ended")),
            outcome=_text(meta.get("outcome")),
            reason=_text(meta.get("reason")),
            cause=_text(meta.get("cause")),
            simulated=bool(meta.get("simulated", False)),
            key=_text(meta.get("key")),
        )

    def _meta_or_rest(self, path: Path) -> dict[str, Any]:
        """Return session.json; where it is damaged it is put aside and a stand-in returned."""
        try:
            return read_object(path / SESSION)
        except FileNotFoundError:
            return _stand_in(path)
        except RecordError:
            with told("move", path / SESSION):
                (path / SESSION).rename(path / "session.damaged")
            return _stand_in(path)


@contextmanager
def _noted(errors: list[RecordError]) -> Iterator[None]:
    """Keep a RecordError for later: one folder that cannot be removed keeps no other."""
    try:
        yield
    except RecordError as error:
        errors.append(error)


def _stand_in(path: Path) -> dict[str, Any]:
    """Return what a session's name alone tells."""
    return {"id": path.name, "job": "unknown", "started": began(path.name).isoformat()}


def _seal(path: Path) -> dict[str, Any]:
    """Return the seal of the lines that are there."""
    try:
        return seal_of(*split_lines(read_bytes(path / EVENTS)))
    except FileNotFoundError:
        return seal_of([])


def _text(value: object) -> str | None:
    """Return what belongs into a list; a value that is no text was not written by a daemon."""
    return value if value is None or isinstance(value, str) else "unreadable"


def _older(summary: Summary, limit: datetime) -> bool:
    """Say whether a session ended before `limit`; its id tells where its time cannot be read."""
    with suppress(ValueError):
        return moment(summary.ended or summary.started) < limit
    return began(summary.id) < limit
