"""Puts a client's events in order: repeats left out, gaps found, and filled from a replay.

No socket is touched here. Every event of a boot is given out once and in its order from the first
that came after the subscription; before them come the latest of each topic, as the daemon sends
them to whoever is new.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

AT_PRESENT: Final = 2**53  # a number that no event has: asked for what follows, only numbers come

Event = tuple[str, dict[str, Any]]
# Returns the daemon's answer to events_since {boot, seq}, None where it cannot be had.
Replay = Callable[[str, int], Mapping[str, Any] | None]


class Sequence:
    """The events of one client; `lost` counts those that no replay could bring back."""

    def __init__(self, replay: Replay) -> None:
        self.lost = 0
        self._replay = replay
        self._boot: str | None = None
        self._seq = 0
        self._last: dict[str, int] = {}

    def begin(self, boot: str, seq: int) -> None:
        """Begin where the daemon stands now: of what is older the latest of each topic counts."""
        if self._boot is None:
            self._boot, self._seq = boot, seq

    def take(self, topic: str, event: dict[str, Any]) -> Iterator[Event]:
        """Take in an event and yield what follows from it, oldest first."""
        boot, seq = str(event.get("boot")), int(event.get("seq", 0))
        if self._boot is None:
            told = self._replay(boot, AT_PRESENT)
            same = told is not None and told["boot"] == boot
            self.begin(boot, int(told["seq"]) if told is not None and same else seq - 1)
        elif boot != self._boot:
            # A daemon that has started anew: all of its events are news, from the first on.
            self._boot, self._seq, self._last = boot, 0, {}
        if seq > self._seq + 1:
            yield from self._fill(seq)
        if seq == self._seq + 1:
            self._seq = seq
        elif seq <= self._last.get(topic, 0) or seq > self._seq:
            return
        self._last[topic] = seq
        yield topic, event

    def _fill(self, upto: int) -> Iterator[Event]:
        """Yield the events between the last one and `upto`, as far as the daemon still has them."""
        boot = self._boot
        assert boot is not None
        while self._seq < upto - 1:
            told = self._replay(boot, self._seq)
            found = told["events"] if told is not None and told["boot"] == boot else []
            fresh = [e for e in found if self._seq < int(e["seq"]) < upto]
            for event in fresh:
                self.lost += int(event["seq"]) - self._seq - 1
                self._seq = self._last[str(event["topic"])] = int(event["seq"])
                yield str(event["topic"]), event
            if not fresh:
                self.lost += upto - 1 - self._seq
                self._seq = upto - 1
