"""The tape: a procedure is followed unchanged, and what it was told can be told again."""

from collections.abc import Generator, Mapping
from typing import Any

import pytest

from legato.control.effects import (
    CellFault,
    Dwell,
    Effect,
    Enter,
    Grab,
    Hold,
    Move,
    PauseRequested,
    ReadArm,
    Record,
    Refused,
    Save,
    StopRequested,
    Why,
)
from legato.control.tape import Untold, answer, asked, ended_by, raised_again, raising, taped
from legato.geometry.motion import StepMove
from legato.hal.arm import ArmReading
from legato.hal.faults import Cause, DeviceError


class Kept:
    """A tape that keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[str, Any]] = []
        self.end: Mapping[str, Any] | None = None

    def asks(self, effect: Effect) -> None:
        """Keep an effect's kind."""
        self.told.append(("asks", type(effect).__name__))

    def answered(self, effect: Effect, result: Any) -> None:
        """Keep an answer."""
        del effect
        self.told.append(("answered", result))

    def raised(self, effect: Effect, error: Exception) -> None:
        """Keep an error's kind."""
        del effect
        self.told.append(("raised", type(error).__name__))

    def ended(self, end: Mapping[str, Any]) -> None:
        """Keep the end, of which there is but one."""
        assert self.end is None
        self.end = end


def work() -> Generator[Effect, Any, str]:
    """Enter a state, dwell, and on a stop read the arm."""
    yield Enter("capture")
    try:
        yield Dwell(1.0)
    except StopRequested:
        reading = yield ReadArm()
        return f"stopped at {reading}"
    return "done"


def test_a_taped_procedure_does_what_it_does_alone() -> None:
    """Effects, answers, errors and the outcome pass through, and are told in order."""
    tape = Kept()
    run = taped(work(), tape)
    assert next(run) == Enter("capture")
    assert run.send(None) == Dwell(1.0)
    assert run.throw(StopRequested()) == ReadArm()
    with pytest.raises(StopIteration) as end:
        run.send(7)
    assert end.value.value == "stopped at 7"
    assert tape.told == [
        ("asks", "Enter"), ("answered", None), ("asks", "Dwell"), ("raised", "StopRequested"),
        ("asks", "ReadArm"), ("answered", 7),
    ]  # fmt: skip
    assert tape.end == {"end": "stopped at 7", "cause": None, "text": None}


def test_an_error_of_the_procedure_is_its_end() -> None:
    """What it raises comes out as it was raised, and is told."""

    def failing() -> Generator[Effect, Any, str]:
        yield ReadArm()
        raise CellFault(Cause.LIMIT, "too far", "closer")

    tape = Kept()
    run = taped(failing(), tape)
    next(run)
    with pytest.raises(CellFault, match="too far"):
        run.send(None)
    assert tape.end == {"end": "fault", "cause": "limit", "text": "too far"}


def test_a_procedure_that_is_taken_away_was_dropped() -> None:
    """Closing it closes the procedure within, so that its own clean-up runs."""
    closed: list[str] = []

    def held() -> Generator[Effect, Any, str]:
        try:
            yield Hold()
        finally:
            closed.append("yes")
        return "done"

    tape = Kept()
    run = taped(held(), tape)
    next(run)
    run.close()
    assert closed == ["yes"]
    assert tape.end is not None
    assert tape.end["end"] == "dropped"


def test_each_effect_is_told_by_what_it_decides() -> None:
    """A motion with every number, a picture and a document by name, a hold by its kind alone."""
    move = Move(StepMove((1, 2, 3, 4, 5, 6), 40), (0,) * 6, (1, 2, 3, 4, 5, 6), Why.PRESS, 7.0)
    assert asked(move) == {
        "steps": [1, 2, 3, 4, 5, 6], "speed": 40, "start": [0] * 6, "target": [1, 2, 3, 4, 5, 6],
        "why": "press", "station": 7.0, "until": None,
    }  # fmt: skip
    assert asked(Grab("verify")) == {"name": "verify"}
    assert asked(Save("calibration.json", {"a": 1})) == {"name": "calibration.json"}
    assert asked(Record("contact", {"a": 1})) == {"kind": "contact"}
    assert asked(Hold()) == {}
    reading = ArmReading((1, 2, 3, 4, 5, 6), contact=True, inputs=9)
    assert answer(reading) == {"registers": (1, 2, 3, 4, 5, 6), "contact": True, "inputs": 9}


@pytest.mark.parametrize(
    "error",
    [
        StopRequested(),
        PauseRequested(),
        CellFault(Cause.CONTACT_LATE, "no contact", "look"),
        DeviceError(Cause.ARM_TIMEOUT, "no answer", "see the plug"),
        Refused(Cause.CALIBRATION_REJECTED, ("one", "two")),
    ],
)
def test_an_error_comes_back_as_it_was(error: Exception) -> None:
    """Kind, cause and words are the same again: the procedure cannot tell the difference."""
    again = raised_again(raising(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert ended_by(again) == ended_by(error)


def test_an_error_that_no_procedure_knows_keeps_its_words() -> None:
    """A full disk is no class of this layer: any error will do in its place."""
    again = raised_again(raising(OSError("disk full")))
    assert isinstance(again, Untold)
    assert str(again) == "disk full"
    assert ended_by(again)["end"] == "fault"
