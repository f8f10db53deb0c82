"""Requests that are answered later: kept by what they wait for and until when, never blocking."""

from collections.abc import Callable
from math import inf

from msgspec import Struct

from legato.daemon.who import Who
from legato.wire.jsonrpc import Call

MOST = 256

# What is waited for: a session's end, a task's, or the devices.
What = tuple[str, str | int]
DEVICES: What = ("devices", 0)


class Ask(Struct, frozen=True):
    """A request with who asks; it came after the gate's first `since` stops."""

    call: Call
    who: Who
    since: int


class Waiter(Struct, frozen=True):
    """One request; at `due` (monotonic s) it is answered as it then stands."""

    ask: Ask
    what: What
    due: float


class Waiters:
    """All requests that wait."""

    def __init__(self) -> None:
        self._waiting: list[Waiter] = []

    @property
    def full(self) -> bool:
        """Whether no more may wait."""
        return len(self._waiting) >= MOST

    def add(self, ask: Ask, what: What, due: float) -> None:
        """Let a request wait for `what`."""
        self._waiting.append(Waiter(ask, what, due))

    def take(self, what: What) -> list[Ask]:
        """Return and forget those who wait for `what`."""
        return [w.ask for w in self._taken(lambda w: w.what == what)]

    def take_due(self, now: float) -> list[Waiter]:
        """Return and forget those whose time is up."""
        return self._taken(lambda w: w.due <= now)

    def take_all(self) -> list[Waiter]:
        """Return and forget all."""
        return self._taken(lambda _: True)

    def next_due(self) -> float:
        """Return when the next one's time is up, infinity where none waits."""
        return min(w.due for w in self._waiting) if self._waiting else inf

    def _taken(self, fits: Callable[[Waiter], bool]) -> list[Waiter]:
        if not self._waiting:
            return []
        taken = [w for w in self._waiting if fits(w)]
        self._waiting = [w for w in self._waiting if not fits(w)]
        return taken
