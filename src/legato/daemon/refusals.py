"""How often the door tells of those whom it turns away, so that no stranger fills the log.

Each is counted. For one address and one kind of refusal there is a line at once, then at most one
a second, of so many times; beyond MOST at a time all others share the lines of `elsewhere`.
"""

from dataclasses import dataclass
from math import inf
from typing import Final

from legato.daemon.messages import TurnedAway

EVERY_S: Final = 1.0
MOST: Final = 16
ELSEWHERE: Final = "elsewhere"


@dataclass
class _Untold:
    """What was not told since the last line, and when the next may be; `why` is the latest's."""

    due: float
    count: int = 0
    why: str = ""


class Refusals:
    """Refusals that wait for their line, by address and kind; times are monotonic s."""

    def __init__(self) -> None:
        self._untold: dict[tuple[str, str], _Untold] = {}

    def take(self, address: str, kind: str, why: str, now: float) -> TurnedAway | None:
        """Count a refusal; return what is to be told of it at once."""
        if (address, kind) not in self._untold and len(self._untold) >= MOST:
            address, kind = ELSEWHERE, ""
        known = self._untold.get((address, kind))
        if known is None:
            self._untold[address, kind] = _Untold(now + EVERY_S)
            return TurnedAway(address, why)
        known.count, known.why = known.count + 1, why
        return None

    def take_due(self, now: float) -> list[TurnedAway]:
        """Return what may be told by now of those who were only counted."""
        due = {key: untold for key, untold in self._untold.items() if untold.due <= now}
        for key, untold in due.items():
            if untold.count:
                self._untold[key] = _Untold(now + EVERY_S)
            else:
                del self._untold[key]
        return [
            TurnedAway(address, _times(untold.why, untold.count))
            for (address, _), untold in due.items()
            if untold.count
        ]

    def next_due(self) -> float:
        """Return when to ask next, infinity where nothing was told within a second."""
        return min((untold.due for untold in self._untold.values()), default=inf)


def _times(why: str, count: int) -> str:
    return why if count == 1 else f"{why}, {count} times"
