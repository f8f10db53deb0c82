"""What goes wrong on request: which fault, when, and how much. Seeded, and kept in a log.

A fault is spelled `KIND[:KEY=VALUE,...]`. `after=N` waits for N commands, `at=S` for a moment of
the line's clock, and each strikes once; `p=P` strikes any command with that probability; without
any of them the first command is struck. `on` says which commands count: step (default), read, any.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from legato.wire.teachmover import Command, Read, Step


class Kind(StrEnum):
    """What can go wrong."""

    SILENCE = "silence"
    """The command is carried out, and its reply never comes."""
    LATE = "late"
    """The reply comes BY seconds late (default 5)."""
    GARBAGE = "garbage"
    """The reply's bytes are replaced by others."""
    REFUSED = "0"
    """The command is answered 0 and not carried out."""
    PENDANT = "2"
    """STOP is pressed during the command: it is broken off and answered 2."""
    HANG_UP = "hang-up"
    """The line hangs up, and is back BY seconds later (default never)."""
    RESTART = "restart"
    """The arm is switched off and on before the command: its registers are zero."""
    LOST_STEPS = "lost-steps"
    """MOTOR (default 2) misses its next BY half-steps (default 60)."""
    STUCK_OPEN = "stuck-open"
    """The grip switch reads open from then on."""
    STUCK_CLOSED = "stuck-closed"
    """The grip switch reads closed from then on."""


BY = {Kind.LATE: 5.0, Kind.LOST_STEPS: 60.0}
COMMANDS: dict[str, type] = {"step": Step, "read": Read, "any": object}


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong; `by` is seconds or half-steps, as its kind says."""

    kind: Kind
    after: int | None = None
    at: float | None = None
    p: float | None = None
    on: str = "step"
    by: float | None = None
    motor: int = 2

    def __str__(self) -> str:
        given = {"after": self.after, "at": self.at, "p": self.p, "on": self.on, "by": self.by}
        return f"{self.kind}:" + ",".join(f"{k}={v}" for k, v in given.items() if v is not None)


def fault(text: str) -> Fault:
    """Return the fault that a text spells. Raises ValueError, saying what is wrong."""
    name, _, rest = text.partition(":")
    if name not in list(Kind):
        raise ValueError(f"no fault {name!r}: there are {', '.join(Kind)}")
    kind = Kind(name)
    given: dict[str, Any] = {}
    for part in filter(None, rest.split(",")):
        key, _, value = part.partition("=")
        if key in given:
            raise ValueError(f"{text}: {key} stands twice")
        given[key] = _value(key, value)
    if sum(key in given for key in ("after", "at", "p")) > 1:
        raise ValueError(f"{text}: one of after, at and p")
    return Fault(kind, **{"by": BY.get(kind)} | given)


def _value(key: str, text: str) -> int | float | str:
    """Return a key's value. Raises ValueError."""
    match key:
        case "on" if text in COMMANDS:
            return text
        case "after" | "motor":
            value: float = int(text)
        case "at" | "p" | "by":
            value = float(text)
        case _:
            raise ValueError(f"{key}={text}: keys are after, at, p, by, motor, on=step|read|any")
    low, high = {"p": (0.0, 1.0), "motor": (1, 6)}.get(key, (0.0, float("inf")))
    if not low <= value <= high:
        raise ValueError(f"{key} is {low:g} to {high:g}, not {text}")
    return value


class Faults:
    """Faults that wait for their moment; `struck` tells which did, when, and upon what."""

    def __init__(self, faults: Iterable[Fault] = (), seed: int = 0) -> None:
        self._waiting = list(faults)
        self._seen = dict.fromkeys(COMMANDS, 0)
        self.rng = np.random.default_rng(seed)
        self.struck: list[dict[str, object]] = []

    @property
    def kinds(self) -> set[Kind]:
        """The kinds that still wait."""
        return {f.kind for f in self._waiting}

    def strike(self, command: Command, now: float) -> list[Fault]:
        """Return what strikes a command at a time in s; what strikes only once is then spent."""
        struck = [f for f in self._waiting if self._strikes(f, command, now)]
        for name, kinds in COMMANDS.items():
            self._seen[name] += isinstance(command, kinds)
        self._waiting = [f for f in self._waiting if f.p is not None or f not in struck]
        self.struck += [{"fault": str(f), "t_s": now, "command": str(command)} for f in struck]
        return struck

    def _strikes(self, fault: Fault, command: Command, now: float) -> bool:
        """Say whether a fault's moment is this command."""
        if not isinstance(command, COMMANDS[fault.on]):
            return False
        if fault.p is not None:
            return bool(self.rng.random() < fault.p)
        return self._seen[fault.on] >= (fault.after or 0) and now >= (fault.at or 0.0)
