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
    """Record, events and state.json together; `clock` is the cell's s, `arm` names a real arm.

    `heard` is told of every event that was published.
    """

    def __init__(
        self,
        sessions: Sessions,
        events: Events,
        store: Store,
        clock: Callable[[], float],
        log: Log,
        last: tuple[Any, Any] = (None, None),
        arm: str | None = None,
        heard: Callable[[str, Mapping[str, Any]], None] = lambda _, __: None,
    ) -> None:
        self._sessions = sessions
        self._events = events
        self._store = store
        self._clock = clock
        self._log = log
        self._last = last
        self._arm = arm
        self._heard = heard
        self._error: RecordError | None = None
        self._state: Mapping[str, Any] | None = None  # what is not on the disk yet

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
        self._heard(topic, data)

    def take_error(self) -> RecordError | None:
        """Return what the disk has refused since this was asked last."""
        error, self._error = self._error, None
        return error

    def keep(self, fault: Mapping[str, Any] | None, view: View) -> None:
        """Keep what the next start must know: fault, reference and registers, and of which arm."""
        if view.memory is not None:
            self._last = view.memory.reference, view.memory.registers
        reference, registers = self._last
        self._state = {
            "boot": self._events.boot,
            "fault": fault,
            "arm": self._arm,
            "simulated": self._arm is None,
            "reference": reference,
            "registers": registers,
        }
        self._save()

    def keep_again(self) -> None:
        """Try once more to keep what the disk did not take, or the next start would not know it."""
        if self._state is not None:
            self._save(again=True)

    def _save(self, *, again: bool = False) -> None:
        assert self._state is not None, "there is something to keep"
        try:
            self._store.save_state(self._state)
            self._state = None
        except RecordError as error:
            if not again:
                self._log.error("state_not_kept", text=error.text, hint=error.hint)
