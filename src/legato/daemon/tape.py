"""A job's tape: what replay needs, written beside the record while the job runs.

start.json has what the procedure knew when it began, effects.jsonl each effect with its answer.
A disk that takes no more ends the tape and nothing else: the record itself meets it too.
"""

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from legato.control.effects import Effect
from legato.control.tape import answer, asked, raising
from legato.daemon.pulse import Pulse
from legato.records.errors import RecordError
from legato.records.session import SessionWriter
from legato.vision.picture import encode_png

if TYPE_CHECKING:
    from legato.daemon.devices import Devices

START = "start"
FROM_PICTURE = ("calibrate",)
FROM_CALIBRATION = ("verify", "home", "massage")

Timed = Callable[[str, float], None]


class JobTape:
    """The tape of one job; `timed` is told how long each kind of effect took, in wall s."""

    def __init__(self, writer: SessionWriter, pulse: Pulse, timed: Timed) -> None:
        self._writer = writer
        self._pulse = pulse
        self._timed = timed
        self._count = 0
        self._began = 0.0
        self._broken = False

    def asks(self, effect: Effect) -> None:
        """Promise an end, and begin to count the time."""
        self._began = time.monotonic()
        self._pulse.promise(type(effect).__name__, self._pulse.allowed.seconds(effect))

    def answered(self, effect: Effect, result: Any) -> None:
        """Write an effect with its answer."""
        told = answer(result)
        self._line(effect, {"answer": told} if told is not None else {})

    def raised(self, effect: Effect, error: Exception) -> None:
        """Write an effect with what was thrown instead of an answer."""
        self._line(effect, {"raised": raising(error)})

    def ended(self, end: Mapping[str, Any]) -> None:
        """Write how the procedure has ended."""
        self._pulse.promise("the job's end", self._pulse.allowed.slowness + 60.0)
        self._write({"n": self._count + 1, **end})

    def _line(self, effect: Effect, outcome: Mapping[str, Any]) -> None:
        name = type(effect).__name__
        self._timed(name, time.monotonic() - self._began)
        self._count += 1
        self._write({"n": self._count, "effect": name, "asked": asked(effect), **outcome})

    def _write(self, line: Mapping[str, Any]) -> None:
        if self._broken:
            return
        try:
            self._writer.effect(line)
        except RecordError:
            self._broken = True


def write_start(writer: SessionWriter, job: str, devices: "Devices", now: float) -> None:
    """Write what the job begins with; `now` is the cell's s. Raises RecordError.

    A calibration is kept as the picture that it was made from: solving is the same every time.
    """
    memory = devices.memory
    start: dict[str, Any] = {
        "job": job,
        "now": now,
        "reference": memory.reference,
        "registers": memory.registers,
        "verified_at": memory.verified_at,
        "picks": memory.picks,
        "frame": None,
        "calibrated": None,
    }
    if job in FROM_PICTURE and memory.frame is not None:
        start["frame"] = writer.frame("start-picture", encode_png(memory.frame.image))
    if job in FROM_CALIBRATION and memory.calibration is not None and devices.solved is not None:
        image = devices.solved[0].image
        start["calibrated"] = writer.frame("start-calibrated", encode_png(image))
    writer.document(START, start)
