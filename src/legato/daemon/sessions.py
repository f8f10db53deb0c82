"""The sessions that this daemon knows: the one that runs, the keys, and how each has ended.

A session's record is written here by the loop; nothing accepted is ever without an outcome.
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from legato.hal.faults import Cause
from legato.records.errors import RecordError
from legato.records.session import SessionWriter
from legato.records.store import Store, Summary

KEPT = 1000


@dataclass
class Session:
    """One session as `session` tells it; the outcome is None while it runs."""

    id: str
    job: str
    key: str | None
    started: str
    simulated: bool
    ended: str | None = None
    outcome: str | None = None
    reason: str | None = None
    cause: str | None = None
    by: str | None = None
    progress: Mapping[str, Any] | None = None
    writer: SessionWriter | None = field(default=None, repr=False)

    def told(self) -> dict[str, Any]:
        """Return what a client is told of it."""
        names = ("id", "job", "started", "ended", "outcome", "reason", "cause", "simulated")
        return {name: getattr(self, name) for name in names}


class Sessions:
    """The book of sessions, newest last; `wall` gives the time of day in UTC."""

    def __init__(
        self,
        store: Store,
        past: Iterable[Summary] = (),
        wall: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self.current: Session | None = None
        self._store = store
        self._wall = wall
        self._known: dict[str, Session] = {}
        self._unsealed: list[Session] = []
        self.learn(past)

    def learn(self, older: Iterable[Summary]) -> None:
        """Take in sessions that are older than those that are known."""
        found = sorted(older, key=lambda s: (s.started, s.id))
        known = {summary.id: _from(summary) for summary in found} | self._known
        self._known = dict(list(known.items())[-KEPT:])

    def close(self, session: str) -> None:
        """Give a session of an earlier daemon its outcome; where the disk refuses the next will."""
        with suppress(RecordError):
            self._store.close_interrupted(session)

    def now(self) -> str:
        """Return the time of day as ISO text."""
        return self._wall().isoformat()

    def begin(self, job: str, key: str | None, meta: Mapping[str, Any]) -> Session:
        """Begin a session and its record. Raises RecordError: then there is no session."""
        started = self.now()
        whole = {"job": job, "params": {}, "key": key, "started": started, **meta}
        writer = self._store.begin(whole)
        by, simulated = meta.get("by"), bool(meta["simulated"])
        session = Session(writer.id, job, key, started, simulated, by=by, writer=writer)
        self._known[session.id] = self.current = session
        while len(self._known) > KEPT:
            del self._known[next(iter(self._known))]
        return session

    def record(self, kind: str, data: Mapping[str, Any], t: float, *, durable: bool) -> None:
        """Write an event into the running session's record, if one runs. Raises RecordError."""
        if self.current is not None and self.current.writer is not None:
            self.current.writer.event(kind, data, t=t, wall=self.now(), durable=durable)

    def end(self, outcome: str, reason: str | None, cause: Cause | None) -> Session:
        """Give the running session its outcome; a disk that does not take it is tried again."""
        session = self.current
        assert session is not None, "only a running session ends"
        session.outcome, session.reason, session.ended = outcome, reason, self.now()
        session.cause = str(cause) if cause is not None else None
        self.current = None
        self._unsealed.append(session)
        self.seal()
        return session

    def seal(self) -> None:
        """Write the outcomes that are not yet on the disk, as far as it takes them."""
        self._unsealed = [s for s in self._unsealed if not _sealed(s)]

    def find(self, session: str) -> Session | None:
        """Return a session by its id, from the disk where it is too old to be remembered."""
        if session in self._known:
            return self._known[session]
        try:
            meta = self._store.read(session).meta
        except (RecordError, ValueError):
            return None
        told = {name: meta.get(name) for name in ("ended", "outcome", "reason", "cause")}
        simulated = bool(meta.get("simulated"))
        job, started = str(meta.get("job")), str(meta.get("started"))
        return Session(session, job, meta.get("key"), started, simulated, **told)

    def with_key(self, key: str) -> Session | None:
        """Return the session that a key has started."""
        return next((s for s in self._known.values() if s.key == key), None)

    def latest(self, limit: int) -> list[dict[str, Any]]:
        """Return what is told of the latest sessions, newest first."""
        return [s.told() for s in list(self._known.values())[::-1][:limit]]


def _sealed(session: Session) -> bool:
    """Write a session's outcome; say whether that has worked."""
    assert session.writer is not None
    assert session.outcome is not None
    assert session.ended is not None
    try:
        session.writer.finish(session.outcome, session.reason, session.cause, session.ended)
    except RecordError:
        return False
    session.writer = None
    return True


def _from(summary: Summary) -> Session:
    return Session(
        id=summary.id,
        job=summary.job,
        key=summary.key,
        started=summary.started,
        simulated=summary.simulated,
        ended=summary.ended,
        outcome=summary.outcome,
        reason=summary.reason,
        cause=summary.cause,
    )
