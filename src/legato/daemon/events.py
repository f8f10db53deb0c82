"""Events: numbered without a gap, the latest of each topic kept, the last thousands for replay.

`boot` is new at every start; `t` is the cell's clock in s.
"""

from collections import deque
from collections.abc import Callable, Mapping
from itertools import islice
from typing import Any

import msgspec

from legato.wire.jsonrpc import encode
from legato.wire.requests import TOPICS

KEPT = 10_000

Publish = Callable[[str, bytes], None]


class Events:
    """Numbers, keeps and publishes; the loop's thread alone uses it."""

    def __init__(
        self, boot: str, clock: Callable[[], float], publish: Publish, kept: int = KEPT
    ) -> None:
        self.boot = boot
        self._clock = clock
        self._publish = publish
        self.seq = 0  # of the latest event
        self._latest: dict[str, tuple[int, bytes]] = {}
        self._ring: deque[tuple[int, bytes]] = deque(maxlen=kept)

    def emit(self, topic: str, session: str | None, data: Mapping[str, Any]) -> None:
        """Publish an event with the next number."""
        if topic not in TOPICS:
            raise ValueError(f"there is no topic {topic!r}")
        self.seq += 1
        head: dict[str, Any] = {
            "topic": topic,
            "boot": self.boot,
            "seq": self.seq,
            "t": self._clock(),
        }
        head["session"] = session
        body = encode(head | dict(data) | head)
        self._latest[topic] = (self.seq, body)
        self._ring.append((self.seq, body))
        self._publish(topic, body)

    def latest(self, prefix: str) -> list[tuple[str, bytes]]:
        """Return the latest event of each topic that a subscription takes in.

        The state comes first, the others oldest first.
        """
        fitting = [t for t in self._latest if t.startswith(prefix)]
        fitting.sort(key=lambda t: (t != "state", self._latest[t][0]))
        return [(topic, self._latest[topic][1]) for topic in fitting]

    def since(self, boot: str, seq: int, limit: int) -> dict[str, Any]:
        """Return events after `seq`, oldest first.

        `complete` is false where some are no longer kept or `boot` is an earlier start; `more`
        says that the limit has cut the list.
        """
        same = boot == self.boot
        after = seq if same else 0
        oldest = self._ring[0][0] if self._ring else self.seq + 1
        first = max(after - oldest + 1, 0)
        found = [msgspec.Raw(body) for _, body in islice(self._ring, first, first + limit)]
        return {
            "boot": self.boot,
            "seq": self.seq,
            "complete": same and after + 1 >= oldest,
            "more": first + len(found) < len(self._ring),
            "events": found,
        }
