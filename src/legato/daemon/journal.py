"""What happens is written down, then published; what must survive a restart is kept in state.json.

A disk that takes nothing stops nobody here: the error is held until the conductor asks for it.
"""

from collections.abc import Callable, Mapping
from typing import Any

from legato.daemon.events import Events
from legato.daemon.log import Log
from legato.daemon.messages import View
from legato.daemon.sessions import Sessions
from legato.records.errors import RecordError
from legato.records.store import Store


class Journal:
    """Record, events and state.json together; `clock` is the cell's s, `arm` names a real arm."""

    def __init__(
        self,
        sessions: Sessions,
        events: Events,
        store: Store,
        clock: Callable[[], float],
        log: Log,
        last: tuple[Any, Any] = (None, None),
        arm: str | None = None,
    ) -> None:
        self._sessions = sessions
        self._events = events
        self._store = store
        self._clock = clock
        self._log = log
        self._last = last
        self._arm = arm
        self._error: RecordError | None = None

    def tell(self, topic: str, data: Mapping[str, Any], *, durable: bool = False) -> None:
        """Record an event under the running session, then publish it."""
        try:
            self._sessions.record(topic, data, self._clock(), durable=durable)
        except RecordError as error:
            self._error = error
        self.publish(topic, data)

    def publish(self, topic: str, data: Mapping[str, Any]) -> None:
        """Publish without a record."""
        current = self._sessions.current
        self._events.emit(topic, current.id if current else None, data)

    def take_error(self) -> RecordError | None:
        """Return what the disk has refused since this was asked last."""
        error, self._error = self._error, None
        return error

    def keep(self, fault: Mapping[str, Any] | None, view: View) -> None:
        """Keep what the next start must know: fault, reference and registers, and of which arm."""
        if view.memory is not None:
            self._last = view.memory.reference, view.memory.registers
        reference, registers = self._last
        state = {
            "boot": self._events.boot,
            "fault": fault,
            "arm": self._arm,
            "simulated": self._arm is None,
        }
        try:
            self._store.save_state(state | {"reference": reference, "registers": registers})
        except RecordError as error:
            self._log.error("state_not_kept", text=error.text, hint=error.hint)
