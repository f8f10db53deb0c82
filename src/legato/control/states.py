"""The cell's states as one table; `transitions` holds the law, this file holds the data.

The machine only decides. Nothing is called back, nothing is queued, and no state can be reached
but by a row of the table.
"""

from collections.abc import Iterable
from itertools import pairwise

from transitions import Machine

IDLE, CAPTURE, CALIBRATE, VERIFY = "idle", "capture", "calibrate", "verify"
MOVE_HOME, PAUSED, STOPPING, FAULT = "move_home", "paused", "stopping", "fault"

# Seconds of wall time after which a state ends in fault `deadline`; idle, paused, fault have none.
DEADLINES = {CAPTURE: 20.0, CALIBRATE: 180.0, VERIFY: 60.0, MOVE_HOME: 120.0, STOPPING: 30.0}
MASSAGE_DEADLINE = 900.0


class NotAllowed(Exception):
    """The table has no row from the present state to the one asked for."""


def massage_state(station: float) -> str:
    """Return the name of a station's massage state, such as `massage_67`."""
    return f"massage_{station:g}"


def states(stations: Iterable[float]) -> tuple[str, ...]:
    """Return every state's name in the order of a run."""
    passes = tuple(massage_state(s) for s in stations)
    return (IDLE, CAPTURE, CALIBRATE, VERIFY, MOVE_HOME, *passes, PAUSED, STOPPING, FAULT)


def deadline(state: str) -> float | None:
    """Return the seconds that a state may last, or None where it may last for ever."""
    return MASSAGE_DEADLINE if state.startswith("massage_") else DEADLINES.get(state)


def moves(state: str) -> bool:
    """Say whether the arm may be sent motion in this state."""
    return state.startswith("massage_") or state in (MOVE_HOME, STOPPING)


def rows(stations: Iterable[float]) -> list[tuple[str, str]]:
    """Return the whole table as (from, to) pairs."""
    passes = [massage_state(s) for s in stations]
    busy = [CAPTURE, CALIBRATE, VERIFY, MOVE_HOME, *passes]
    table = [(CAPTURE, CALIBRATE), (CALIBRATE, VERIFY), (VERIFY, MOVE_HOME)]
    table += [(MOVE_HOME, p) for p in passes] + [(p, MOVE_HOME) for p in passes]
    table += list(pairwise(passes))
    table += [(s, PAUSED) for s in (MOVE_HOME, *passes)]
    table += [(PAUSED, s) for s in (MOVE_HOME, *passes)]
    table += [(IDLE, s) for s in busy] + [(s, IDLE) for s in busy]
    table += [(s, STOPPING) for s in (*busy, PAUSED)] + [(STOPPING, IDLE), (FAULT, IDLE)]
    table += [(s, FAULT) for s in (IDLE, *busy, PAUSED, STOPPING)]
    return table


class CellMachine:
    """The present state and the only way to change it."""

    def __init__(self, stations: Iterable[float], initial: str = IDLE) -> None:
        stations = tuple(stations)
        self._model = _Model()
        self._machine = Machine(
            model=self._model,
            states=list(states(stations)),
            initial=initial,
            auto_transitions=False,
            queued=False,
            send_event=False,
        )
        for source, target in rows(stations):
            self._machine.add_transition(_trigger(target), source, target)

    @property
    def state(self) -> str:
        """The present state."""
        return self._model.state

    def allows(self, target: str) -> bool:
        """Say whether the table has a row from the present state to `target`."""
        return _trigger(target) in self._machine.get_triggers(self.state)

    def enter(self, target: str) -> bool:
        """Go to `target`; False where the machine is there already. Raises NotAllowed."""
        if target == self.state:
            return False
        if not self.allows(target):
            raise NotAllowed(f"no way from {self.state} to {target}")
        return bool(self._machine.events[_trigger(target)].trigger(self._model))


class _Model:
    """What `transitions` hangs its state on."""

    state: str


def _trigger(target: str) -> str:
    return f"enter_{target}"
