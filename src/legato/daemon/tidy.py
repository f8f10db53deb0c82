"""When old records go: at the start, once a day, and soon whenever the disk runs short.

The worker's thread alone uses this; a session may begin meanwhile.
"""

import time
from collections.abc import Callable
from datetime import UTC, datetime

from legato.daemon.log import Log
from legato.records.store import Store

DAILY_S = 86400.0
SOON_S = 60.0  # between two attempts while there is too little room


class Tidy:
    """Removes finished sessions by age and by free space; `now` is monotonic s, `wall` UTC."""

    def __init__(
        self,
        store: Store,
        log: Log,
        *,
        keep_days: float,
        keep_newest: int,
        min_free_mb: float,
        now: Callable[[], float] = time.monotonic,
        wall: Callable[[], datetime] = lambda: datetime.now(UTC),
    ) -> None:
        self._store = store
        self._log = log
        self._keep_days = keep_days
        self._keep_newest = keep_newest
        self._min_free_mb = min_free_mb
        self._now = now
        self._wall = wall
        self._last: float | None = None
        self._was_short = False

    def __call__(self) -> None:
        """Remove what is due, if anything is. Raises RecordError."""
        now, last = self._now(), self._last
        if last is not None and now - last < (SOON_S if self._short() else DAILY_S):
            return
        self._last = now
        if last is None:
            self._store.sweep()  # nothing can begin before the devices are known
        removed = self._store.prune(
            self._keep_days,
            self._wall(),
            min_free_mb=self._min_free_mb,
            keep_newest=self._keep_newest,
        )
        if removed:
            self._log.info("pruned", sessions=len(removed), oldest=removed[0], newest=removed[-1])
        short = self._short()
        if short and not self._was_short:
            free = round(self._store.free_mb())
            hint = "free space: no job begins before"
            self._log.warning("disk_short", free_mb=free, needed_mb=self._min_free_mb, hint=hint)
        self._was_short = short

    def _short(self) -> bool:
        return self._store.free_mb() < self._min_free_mb
