"""When faults strike: by the cell's time, by the number of the call, or by lot, each seeded."""

from collections.abc import Iterable

import numpy as np

from legato.drivers.faulty.settings import FaultSettings
from legato.hal.clock import Clock


class Script:
    """The faults of one device; its time begins when this is made."""

    def __init__(self, faults: Iterable[FaultSettings], clock: Clock) -> None:
        self.clock = clock
        began = clock.monotonic()
        self._faults = [_Waiting(fault, began) for fault in faults]

    def struck_by(self, call: str) -> list[FaultSettings]:
        """Return what strikes a call that is made now, in the order of the list."""
        now = self.clock.monotonic()
        # Every one counts the call, also where another strikes it.
        return [waiting.fault for waiting in self._faults if waiting.strikes(call, now)]


class _Waiting:
    """One fault, and what it has seen so far."""

    def __init__(self, fault: FaultSettings, began: float) -> None:
        self.fault = fault
        self._began = began
        self._seen = 0
        self._left = 0
        self._until = began
        self._spent = False
        self._rng = np.random.default_rng(fault.seed)

    def strikes(self, call: str, now: float) -> bool:
        """Say whether it strikes a call."""
        counted = self.fault.counted in (call, "any")
        self._seen += counted
        begins = counted and not self._spent and self._due(now)
        if begins:
            self._spent = self.fault.p is None
            self._left, self._until = self.fault.calls, now + self.fault.for_s
        if counted and self._left > 0:
            self._left -= 1
            return True
        return now < self._until

    def _due(self, now: float) -> bool:
        """Say whether a counted call is the one that it begins at."""
        fault = self.fault
        if fault.p is not None:
            return bool(self._rng.random() < fault.p)
        if fault.call is not None:
            return self._seen == fault.call
        return now - self._began >= (fault.at_s or 0.0)
