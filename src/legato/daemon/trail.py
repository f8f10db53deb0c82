"""What a job did last: the evidence beside a fault, also where the loop must not wait for it.

The worker adds, either thread reads.
"""

import threading
from collections import deque
from typing import Any, Final

from legato.hal.arm import Traced

KEPT: Final = 8  # effects
TRIES: Final = 5


class Trail:
    """The last effects of the running job, its last picture, what was solved, and the arm's line.

    `begin` forgets those of the job before.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._line: Traced | None = None
        self.begin(None)

    def begin(self, arm: object) -> None:
        """Begin anew, for a job with this arm."""
        with self._lock:
            # Asked for here: the question itself reads the line.
            self._line = arm if isinstance(arm, Traced) else None
            self._effects: deque[str] = deque(maxlen=KEPT)
            self._more: dict[str, Any] = {"picture": None}

    def add(self, effect: str) -> None:
        """Add an effect that is about to be performed."""
        with self._lock:
            self._effects.append(effect)

    def note(self, **found: Any) -> None:
        """Keep what an effect has found, until another finds it anew."""
        with self._lock:
            self._more |= found

    def evidence(self) -> dict[str, Any]:
        """Return all of it, ready for a record."""
        with self._lock:
            told = {"last_effects": list(self._effects), **self._more}
            line = self._line
        return told | {"last_bytes": _last_bytes(line)}


def _last_bytes(line: Traced | None) -> list[str]:
    """Return what passed on the arm's line last; nothing where the arm remembers nothing."""
    if line is None:
        return []
    for _ in range(TRIES):
        try:
            return list(line.last_bytes)
        except RuntimeError:  # the worker adds to it at this very moment
            continue
    return []
