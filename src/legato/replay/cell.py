"""The cell that a record stands for: it performs a procedure's effects by what was recorded.

Pictures, readings and interrupts are the record's. What a procedure decides (where it goes, what
it says, what the pictures mean, what the envelope forbids) is held to the record, and the first
difference is raised as Differs.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from legato.control import envelope
from legato.control.effects import (
    CellFault,
    Effect,
    Enter,
    Find,
    Grab,
    Move,
    ReadArm,
    Record,
    Refused,
    Save,
    Solve,
)
from legato.control.memory import Memory
from legato.control.perceive import find_marks_in, perceive
from legato.control.settings import CellSettings
from legato.control.tape import INTERRUPTS, asked, raised_again
from legato.geometry.motion import Steps
from legato.hal.arm import ArmReading
from legato.hal.faults import Cause
from legato.records.ids import moment
from legato.records.record import SessionRecord
from legato.records.session import FRAMES
from legato.replay.differs import Differs, hold
from legato.replay.rows import Rows
from legato.replay.start import Start, frame_of

TOLD = ("progress", "contact")
OWN_STATES = ("idle", "fault", "stopping")  # the daemon's: it enters them by itself


class EndOfTape(Exception):
    """The record has no more effects: it was broken off here."""


class RecordedCell:
    """Performs effects one after another; `count` says how many."""

    def __init__(self, record: SessionRecord, start: Start) -> None:
        self.count = 0
        self.saved: dict[str, Mapping[str, Any]] = {}
        self._record = record
        self._settings: CellSettings = start.settings
        self._memory: Memory = start.memory
        self._tape = iter([line for line in record.effects if "effect" in line])
        self._rows = Rows(record)
        self._told = iter([e for e in record.events if _is_procedures(e)])
        self._states = _states(record)
        self._state = next(self._states, None)  # the daemon enters the first one by itself
        self._began_s = moment(str(record.meta["started"])).timestamp()

    def perform(self, effect: Effect) -> Any:
        """Return what the record answers; raises what it raises, Differs, and EndOfTape."""
        line = next(self._tape, None)
        if line is None:
            raise EndOfTape
        self.count += 1
        where = f"effect {self.count}"
        hold(f"{where}, kind", line.get("effect"), type(effect).__name__)
        hold(f"{where} ({type(effect).__name__})", line.get("asked"), asked(effect))
        raised = line.get("raised")
        if raised is not None and raised.get("error") in INTERRUPTS:
            raise raised_again(raised)
        return self._performed(where, effect, line.get("answer") or {}, raised)

    def left(self) -> str | None:
        """Return what the record still has that the procedure did not do, None where nothing."""
        effect, told = next(self._tape, None), next(self._told, None)
        if effect is not None:
            return f"effect {self.count + 1}, {effect.get('effect')}"
        if told is not None:
            return f"event {told['seq']}, {told['kind']}"
        return self._rows.left()

    def _performed(self, where: str, effect: Effect, answer: Mapping[str, Any], raised: Any) -> Any:
        match effect:
            case Find() | Solve():
                return self._seen(where, effect, raised)
            case Move():
                return self._moved(where, effect, answer, raised)
        if raised is not None:
            raise raised_again(raised)
        match effect:
            case Grab(name):
                return frame_of(self._record, f"{FRAMES}/{name}.png", answer)
            case ReadArm():
                reading = self._reading(answer)
                if self._memory.reference is not None:
                    self._rows.read(where, reading, self._memory.reference)
                return reading
            case Enter(state):
                self._enter(where, state)
            case Record(kind, data):
                self._say(where, kind, data)
            case Save(name, document):
                self.saved[name] = document
        return None

    def _seen(self, where: str, effect: Find | Solve, raised: Any) -> Any:
        """Look at the picture again; what it means must be what it meant."""
        picture, picks, seed = effect.frame.image, effect.picks, self._settings.calibration.seed
        try:
            if isinstance(effect, Find):
                found: Any = find_marks_in(picture, self._settings, seed=seed, picks=picks)
            else:
                found = perceive(
                    picture, self._settings, seed=seed, picks=picks, now_s=self._began_s
                )
        except (CellFault, Refused) as error:
            hold(f"{where}, fault", (raised or {}).get("cause"), str(error.cause))
            raise
        hold(f"{where}, fault", (raised or {}).get("cause"), None)
        if raised is not None:
            raise raised_again(raised)
        return found

    def _moved(self, where: str, move: Move, answer: Mapping[str, Any], raised: Any) -> ArmReading:
        """Ask the envelope again, then give the arm's recorded answer."""
        cause = (raised or {}).get("cause")
        leg = self._memory.calibration
        try:
            envelope.check(self._settings, leg.world_from_object if leg else None, move)
        except CellFault as error:
            hold(f"{where}, envelope", cause, str(error.cause))
            raise
        if raised is not None:
            if cause == Cause.FOLLOWING_ERROR:
                self._rows.skip(where, move)
            raise raised_again(raised)
        assert self._memory.reference is not None, "the procedure has asked where the arm stands"
        reading = self._reading(answer)
        self._rows.move(where, move, reading, self._memory.reference)
        return reading

    def _reading(self, answer: Mapping[str, Any]) -> ArmReading:
        one, two, three, four, five, six = (int(v) for v in answer["registers"])
        registers: Steps = (one, two, three, four, five, six)
        self._memory.registers = registers
        return ArmReading(registers, bool(answer["contact"]), int(answer.get("inputs", 0)))

    def _enter(self, where: str, state: str) -> None:
        if state == self._state or state in OWN_STATES:
            return
        recorded = next(self._states, None)
        if recorded is not None or not self._broken_off:
            hold(f"{where}, state", recorded, state)
        self._state = state

    def _say(self, where: str, kind: str, data: Mapping[str, Any]) -> None:
        event = next(self._told, None)
        if event is None:
            if self._broken_off:
                return
            raise Differs(f"{where}, {kind}", None, data)
        at = f"event {event['seq']}"
        hold(f"{at}, kind", event["kind"], kind)
        hold(f"{at} ({kind})", event["data"], data)

    @property
    def _broken_off(self) -> bool:
        """Whether the daemon may have ended before it wrote down all that the worker did."""
        return self._record.meta.get("outcome") in (None, "interrupted")


def _is_procedures(event: Mapping[str, Any]) -> bool:
    """Say whether a procedure told an event; a picture's next try is the worker's own business."""
    return event["kind"] in TOLD and "retry" not in event["data"]


def _states(record: SessionRecord) -> Iterator[str]:
    """Yield the states that the procedure has asked for, in order."""
    for event in record.of_kind("state"):
        state = event["data"].get("state")
        if state not in OWN_STATES:
            yield str(state)
