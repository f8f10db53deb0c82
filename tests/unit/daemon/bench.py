"""Fakes that are handed to the daemon's parts: arm, camera, clock, log, and a worker over them."""

import queue
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from legato.config.build import cell_settings
from legato.config.load import Loaded
from legato.config.schema import CellTable, Config
from legato.control.effects import Effect, Move, Why
from legato.control.memory import Memory
from legato.control.settings import CellSettings
from legato.daemon.cell import Cell
from legato.daemon.devices import steps_of
from legato.daemon.messages import DevicesKnown, JobEnded, Message, StateWanted
from legato.daemon.orders import DoJob, Orders, Quit
from legato.daemon.worker import Worker
from legato.geometry.motion import StepMove, Steps, ToolPose, move_between
from legato.hal.arm import ArmReading, Witness
from legato.hal.camera import Frame
from legato.hal.faults import DeviceError
from legato.records.session import SessionWriter
from legato.records.store import Store

Work = Generator[Effect, Any, str]
M = TypeVar("M", bound=Message)

STARTED = "2026-03-01T10:00:00+00:00"
ZERO: Steps = (0, 0, 0, 0, 0, 0)


@cache
def settings() -> CellSettings:
    """Return a cell's settings with the defaults of the configuration."""
    cell = CellTable(camera_at_mm=(228.6, -101.6, 50.8), camera_looks_at_mm=(126.0, -11.0, 36.0))
    return cell_settings(Loaded(Config(cell=cell), Path("cell.toml"), "hash", {}))


class Clock:
    """Cell time that passes only by sleeping; `on_sleep` is told of every nap."""

    def __init__(self) -> None:
        self.now = 0.0
        self.on_sleep: Callable[[], None] = lambda: None

    def monotonic(self) -> float:
        """Return the seconds slept."""
        return self.now

    def sleep(self, seconds: float) -> None:
        """Let time pass at once."""
        self.now += seconds
        self.on_sleep()


@dataclass
class Arm:
    """An arm that counts; `on_step` may raise, `off_by` makes the registers differ."""

    registers: Steps = (0, 0, 0, 0, 0, 0)
    simulated: bool = False
    position_in_doubt: bool = False
    moves: list[StepMove] = field(default_factory=list)
    calls: list[str] = field(default_factory=list)
    missing: DeviceError | None = None
    off_by: int = 0
    on_step: Callable[[], None] = lambda: None
    last_bytes: tuple[str, ...] = ("@READ", "ok")

    def open(self) -> None:
        """Connect, or raise what is missing."""
        self.calls.append("open")
        if self.missing is not None:
            raise self.missing

    def close(self) -> None:
        """Let go."""
        self.calls.append("close")

    def read(self) -> ArmReading:
        """Return the registers."""
        if self.missing is not None:
            raise self.missing
        return ArmReading(self.registers, contact=False)

    def step(self, move: StepMove) -> ArmReading:
        """Count a motion."""
        self.moves.append(move)
        self.on_step()
        a, b, c, d, e, f = (r + s for r, s in zip(self.registers, move.steps, strict=True))
        self.registers = (a + self.off_by, b, c, d, e, f)
        return self.read()

    def zero(self) -> None:
        """Zero the registers."""
        self.calls.append("zero")
        self.registers = (0, 0, 0, 0, 0, 0)


@dataclass
class Camera:
    """A camera that gives a small grey picture."""

    simulated: bool = False
    missing: DeviceError | None = None
    closed: bool = False

    def open(self) -> None:
        """Connect, or raise what is missing."""
        if self.missing is not None:
            raise self.missing

    def close(self) -> None:
        """Let go."""
        self.closed = True

    def grab(self) -> Frame:
        """Return a picture."""
        if self.missing is not None:
            raise self.missing
        return Frame(np.zeros((8, 8), dtype=np.uint8), 0.25, 1, "fake")


class World:
    """A witness of nothing much."""

    def testimony(self) -> dict[str, object]:
        """Return the truth."""
        return {"touches": []}


class Silent:
    """A log that keeps what it is told."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, dict[str, Any]]] = []

    def debug(self, event: str, **fields: Any) -> None:
        """Keep a line."""
        self.lines.append((event, fields))

    info = warning = error = debug


@dataclass
class Bench:
    """A worker on fakes, with everything it says; states that it wants are granted."""

    folder: Path
    arm: Arm = field(default_factory=Arm)
    camera: Camera = field(default_factory=Camera)
    clock: Clock = field(default_factory=Clock)
    orders: Orders = field(default_factory=Orders)
    messages: "queue.Queue[Message]" = field(default_factory=queue.Queue)
    heard: list[Message] = field(default_factory=list)
    log: Silent = field(default_factory=Silent)
    witness: Witness | None = None
    stands_at: ToolPose | None = None
    last: tuple[Steps | None, Steps | None] = (None, None)
    look_s: float = 60.0
    tidy: Callable[[], None] = lambda: None
    work: Callable[[Memory], Work] | None = None
    worker: Worker | None = None
    writer: SessionWriter | None = None

    def start(self) -> DevicesKnown:
        """Start the worker and return what it tells of its devices."""
        cell = Cell(self.arm, self.camera, self.clock, self.witness, self.stands_at)

        def procedures(job: str, given: CellSettings, memory: Memory, now: float) -> Work:
            assert (job, now) == ("run", self.clock.now)
            assert given is settings()
            assert self.work is not None
            return self.work(memory)

        self.worker = Worker(
            lambda: cell,
            settings(),
            self.orders,
            self.messages.put,
            self.log,
            last=self.last,
            procedures=procedures,
            tidy=self.tidy,
            look_s=self.look_s,
        )
        self.worker.start()
        return self.until(DevicesKnown)

    def until(self, kind: type[M]) -> M:
        """Return the next message of a kind; what comes before it is heard, states granted."""
        while True:
            message = self.messages.get(timeout=10.0)
            self.heard.append(message)
            if isinstance(message, StateWanted):
                self.orders.answer(True)
            if isinstance(message, kind):
                return message

    def begin(self, work: Callable[[Memory], Work]) -> SessionWriter:
        """Hand a procedure to the worker under a real record."""
        self.work = work
        self.writer = Store(self.folder).begin({"job": "run", "started": STARTED})
        self.orders.give(DoJob(self.writer.id, "run", self.writer))
        return self.writer

    def run(self, work: Callable[[Memory], Work]) -> JobEnded:
        """Carry out a procedure and return how it ended."""
        self.begin(work)
        return self.run_end()

    def run_end(self) -> JobEnded:
        """Return how the running procedure ended."""
        return self.until(JobEnded)

    def quit(self) -> bool:
        """End the worker; say whether it has ended."""
        self.orders.give(Quit())
        assert self.worker is not None
        ended = self.worker.join(10.0)
        if self.writer is not None:
            self.writer.close()
        return ended


def home_steps() -> Steps:
    """Return the absolute steps of the parked pose."""
    return steps_of(settings(), settings().home)


def shifted(steps: Steps, by: int) -> Steps:
    """Return steps with the base motor further by some."""
    return (steps[0] + by, *steps[1:])


def turn(start: Steps, by: int = 20) -> Move:
    """Return a motion of the base motor alone."""
    target = shifted(start, by)
    move = move_between(settings().arm, start, target, settings().speed_scale)
    return Move(move, start, target, Why.TRANSIT)
