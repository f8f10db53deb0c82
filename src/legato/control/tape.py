"""A procedure followed from outside: each effect that it asked for, and what it was answered.

What is told here is all that a procedure ever learns of the world beside its pictures, so that
the same answers drive it to the same decisions again.
"""

from collections.abc import Generator, Mapping
from dataclasses import asdict
from typing import Any, Protocol

from legato.control.effects import (
    CellFault,
    Dwell,
    Effect,
    Enter,
    Grab,
    Move,
    PauseRequested,
    Record,
    Refused,
    Save,
    StopRequested,
)
from legato.hal.arm import ArmReading
from legato.hal.camera import Frame
from legato.hal.faults import Cause, DeviceError

INTERRUPTS: Mapping[str, type[Exception]] = {
    "StopRequested": StopRequested,
    "PauseRequested": PauseRequested,
}


class Tape(Protocol):
    """Who is told of every effect, in the worker's thread, before and after it is performed."""

    def asks(self, effect: Effect) -> None:
        """Tell that the procedure wants an effect."""

    def answered(self, effect: Effect, result: Any) -> None:
        """Tell what the effect has given."""

    def raised(self, effect: Effect, error: Exception) -> None:
        """Tell what was thrown into the procedure instead."""

    def ended(self, end: Mapping[str, Any]) -> None:
        """Tell how the procedure has ended: `end`, `cause` and `text`."""


def taped(work: Generator[Effect, Any, str], tape: Tape) -> Generator[Effect, Any, str]:
    """Return a procedure that does what `work` does, and tells `tape` of it."""
    end: Mapping[str, Any] = {"end": "dropped", "cause": None, "text": None}
    try:
        effect = next(work)
        while True:
            tape.asks(effect)
            try:
                result = yield effect
            except Exception as error:  # noqa: BLE001  # whatever it is, the procedure is told
                tape.raised(effect, error)
                effect = work.throw(error)
            else:
                tape.answered(effect, result)
                effect = work.send(result)
    except StopIteration as stop:
        end = {"end": stop.value, "cause": None, "text": None}
        return str(stop.value)
    except Exception as error:
        end = ended_by(error)
        raise
    finally:
        work.close()
        tape.ended(end)


def asked(effect: Effect) -> dict[str, Any]:
    """Return what an effect asks for, ready for JSON; pictures and documents by name only."""
    match effect:
        case Enter(state):
            return {"state": state}
        case Grab(name) | Save(name):
            return {"name": name}
        case Dwell(seconds):
            return {"seconds": seconds}
        case Record(kind):
            return {"kind": kind}
        case Move():
            return {
                "steps": list(effect.move.steps),
                "speed": effect.move.speed,
                "start": list(effect.start),
                "target": list(effect.target),
                "why": str(effect.why),
                "station": effect.station,
                "until": effect.until,
            }
        case _:
            return {}


def answer(result: Any) -> dict[str, Any] | None:
    """Return an answer ready for JSON; None where it can be found again otherwise."""
    match result:
        case ArmReading():
            return asdict(result)
        case Frame(age_s=age, sequence=number, source=source):
            return {"age_s": age, "sequence": number, "source": source}
        case _:
            return None


def raising(error: Exception) -> dict[str, Any]:
    """Return an error ready for JSON."""
    told: dict[str, Any] = {"error": type(error).__name__, "text": str(error)}
    match error:
        case CellFault() | DeviceError():
            told |= {"cause": str(error.cause), "text": error.text, "hint": error.hint}
        case Refused():
            told |= {"cause": str(error.cause), "reasons": list(error.reasons)}
    return told


class Untold(Exception):
    """Stands for an error of which the tape knows the name and text alone."""


def raised_again(told: Mapping[str, Any]) -> Exception:
    """Return the error that was told; one that no procedure tells apart as Untold."""
    name, text = str(told.get("error")), str(told.get("text", ""))
    if name in INTERRUPTS:
        return INTERRUPTS[name]()
    if name == "Refused":
        return Refused(Cause(told["cause"]), tuple(told["reasons"]))
    if name in ("CellFault", "DeviceError"):
        kind: type[CellFault | DeviceError] = CellFault if name == "CellFault" else DeviceError
        return kind(Cause(told["cause"]), text, str(told.get("hint", "")))
    return Untold(text)


def ended_by(error: Exception) -> dict[str, Any]:
    """Return how an error ends a procedure."""
    match error:
        case StopRequested():
            return {"end": "stopped", "cause": None, "text": None}
        case Refused():
            return {"end": "refused", "cause": str(error.cause), "text": str(error)}
        case CellFault() | DeviceError():
            return {"end": "fault", "cause": str(error.cause), "text": error.text}
        case _:
            return {"end": "fault", "cause": None, "text": str(error)}
