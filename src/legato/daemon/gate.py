"""The gate before every motion: the stop line closes it, the worker passes it, without a lock.

Each attribute has one writer, and each write is one assignment. The worker says that it begins a
motion before it looks at the gate; the stop line closes the gate before it looks whether a motion
is on its way. So one of the two always sees the other, and what is confirmed is true.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

ENDS_KEPT = 4


@dataclass(frozen=True)
class Moment:
    """One moment on both clocks: monotonic s, and s since 1970 for people."""

    t: float
    wall: float


def present() -> Moment:
    """Return this moment."""
    return Moment(time.monotonic(), time.time())


@dataclass(frozen=True)
class Asked:
    """One stop or estop of the stop line; numbers rise."""

    number: int
    estop: bool
    by: str
    received: Moment


@dataclass(frozen=True)
class Ended:
    """One motion that is over; `problem` says why the driver has not confirmed it."""

    number: int
    at: Moment
    problem: str | None = None


class Gate:
    """What the stop line has asked for, and whether a motion is on its way.

    `ring` is called at the end of every motion.
    """

    def __init__(self, moment: Callable[[], Moment] = present) -> None:
        self.ring: Callable[[], None] = lambda: None
        self.estop: Asked | None = None
        self.stop: Asked | None = None
        self.number = 0
        self._moment = moment
        self._opened = 0
        self._seen = 0
        self._drained = 0
        self._begun = 0
        self._ends: tuple[Ended, ...] = (Ended(0, Moment(0.0, 0.0)),)

    # The stop line's side.

    def ask(self, by: str, received: Moment, *, estop: bool) -> Asked:
        """Ask for a stop, or close the gate: from here on no motion begins."""
        asked = Asked(self.number + 1, estop, by, received)
        if estop:
            self.estop = asked
        else:
            self.stop = asked
        self.number = asked.number
        return asked

    def on_its_way(self) -> int | None:
        """Return the number of the motion that may be on its way, None where none is."""
        begun = self._begun
        return begun if begun > self._ends[-1].number else None

    def end_of(self, motion: int) -> Ended | None:
        """Return how a motion has ended, None while it has not."""
        ends = self._ends
        return next((e for e in ends if e.number >= motion), None)

    def drained(self, asked: Asked) -> bool:
        """Say whether the loop knows which requests came before a stop."""
        return self._drained >= asked.number

    # The loop's side.

    def drain(self, number: int) -> None:
        """Say that every request that came before stop `number` is known to have done so."""
        if number > self._drained:
            self._drained = number
            self.ring()

    @property
    def closed(self) -> bool:
        """Whether an estop keeps every motion back."""
        return self.estop is not None and self.estop.number > self._opened

    def reopen(self, number: int) -> None:
        """Let motions pass again, unless an estop came after `number`."""
        self._opened = number

    def news(self) -> list[Asked]:
        """Return the latest estop and stop, as far as this has not returned them before."""
        if self.number == self._seen:
            return []
        seen, both = self._seen, (self.estop, self.stop)
        found = [asked for asked in both if asked is not None and asked.number > seen]
        self._seen = max([seen, *(asked.number for asked in found)])
        return found

    def stopped_since(self, number: int) -> bool:
        """Say whether a stop or estop was asked for after the first `number`."""
        return self.number > number

    # The worker's side.

    def begin(self) -> int:
        """Say that a motion is about to begin; the gate is looked at after this."""
        self._begun += 1
        return self._begun

    def end(self, problem: str | None = None) -> None:
        """Say that the motion is over: the driver has answered, or has a problem."""
        ended = Ended(self._begun, self._moment(), problem)
        self._ends = (*self._ends[1 - ENDS_KEPT :], ended)
        self.ring()
