"""What a procedure may ask of the world. The daemon performs an effect and sends its result back.

`Enter` -> None, `Grab` -> Frame, `Find` -> Picking, `Solve` -> Calibration, `Move` and `ReadArm`
-> ArmReading, `Dwell`, `Record`, `Save` -> None, `Hold` -> None once the operator resumes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from legato.geometry.motion import StepMove, Steps
from legato.hal.camera import Frame
from legato.hal.faults import Cause


class Why(StrEnum):
    """What a motion is for; it decides what the safety envelope allows."""

    TRANSIT = "transit"
    APPROACH = "approach"
    DESCEND = "descend"
    PRESS = "press"
    DRAW = "draw"
    RETRACT = "retract"


@dataclass(frozen=True)
class Enter:
    """Take the machine to a state; the procedure goes on once that is published and recorded.

    Entering the state that the machine is in already does nothing.
    """

    state: str


@dataclass(frozen=True)
class Grab:
    """Take a picture and keep it in the record under `name`."""

    name: str


@dataclass(frozen=True)
class Find:
    """Find the marks in a picture, near a person's `picks` where there are some.

    MarksNotFound counts as fault marks_not_found.
    """

    frame: Frame
    picks: Mapping[str, tuple[float, float]] | None = None


@dataclass(frozen=True)
class Solve:
    """Find the leg in a picture: its marks, then camera and pose."""

    frame: Frame
    picks: Mapping[str, tuple[float, float]] | None = None


@dataclass(frozen=True)
class Move:
    """Carry out one motion command.

    `start` and `target` are absolute half-steps (see geometry.arm) before and after it. The
    fingertip may touch the leg at `station`, or from there on to `until`; nowhere while None.
    """

    move: StepMove
    start: Steps
    target: Steps
    why: Why
    station: float | None = None
    until: float | None = None


@dataclass(frozen=True)
class ReadArm:
    """Read registers and switch without moving."""


@dataclass(frozen=True)
class Dwell:
    """Let seconds of the cell's time pass."""

    seconds: float


@dataclass(frozen=True)
class Record:
    """Publish and record an event: `kind` is a topic of the wire (progress, contact)."""

    kind: str
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Save:
    """Keep a JSON document in the session's folder under `name`, replacing an earlier one."""

    name: str
    document: Mapping[str, Any]


@dataclass(frozen=True)
class Hold:
    """Wait until the operator resumes, or stops: then StopRequested is thrown at this effect.

    The procedure has entered state paused before, and enters the state it left afterwards.
    """


Effect = Enter | Grab | Find | Solve | Move | ReadArm | Dwell | Record | Save | Hold


class StopRequested(Exception):
    """Thrown into a procedure: finish, retract, end as stopped."""


class PauseRequested(Exception):
    """Thrown into a procedure: retract to the next safe point and yield Hold."""


class Refused(Exception):
    """Raised by a procedure that must not go on though nothing is at fault; one text a reason."""

    def __init__(self, cause: Cause, reasons: tuple[str, ...]) -> None:
        self.cause = cause
        self.reasons = reasons
        super().__init__("; ".join(reasons))


class CellFault(Exception):
    """Raised by a procedure or a device: the cell goes to fault with this cause and evidence."""

    def __init__(
        self, cause: Cause, text: str, hint: str, evidence: Mapping[str, Any] | None = None
    ) -> None:
        self.cause = cause
        self.text = text
        self.hint = hint
        self.evidence = dict(evidence or {})
        super().__init__(f"{cause}: {text}")
