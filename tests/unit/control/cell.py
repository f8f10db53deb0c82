"""A cell for procedures: settings, a calibration from a stated pose, and somebody who performs."""

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from legato.calibration.problem import EngineSettings, KnownIntrinsics
from legato.control import effects as do
from legato.control import envelope
from legato.control.jobs import procedure
from legato.control.memory import Memory
from legato.control.perceive import Calibration, solve_marks
from legato.control.settings import CalibrationSettings, CellSettings, MassageSettings, Workspace
from legato.drivers.sim.arm import SimArm
from legato.drivers.sim.clock import ManualClock
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import World
from legato.geometry.arm import ArmModel
from legato.geometry.leg import Leg
from legato.geometry.motion import StepMove, Steps, ToolPose, pose_steps, rounded
from legato.geometry.projection import Intrinsics, project
from legato.geometry.shapes import Shapes
from legato.geometry.transforms import Array, invert, look_at
from legato.hal.arm import ArmReading
from legato.hal.camera import Frame
from legato.vision.marks import FoundMark, Picking

STATIONS = (7.0, 67.0, 127.0, 187.0)
HOME = ToolPose(127.0, 0.0, 150.0)


def cell_settings(**changes: Any) -> CellSettings:
    """Return the paper's cell with a perfect camera."""
    nominal = Intrinsics(652.0, 655.0, 346.0, 279.0)
    values: dict[str, Any] = {
        "leg": Leg(),
        "stations": STATIONS,
        "approach": 10.0,
        "arm": ArmModel(),
        "shapes": Shapes(ArmModel(), Leg(), 0.0),
        "speed_scale": 0.8,
        "home": HOME,
        "start": ToolPose(127.0, 0.0, 0.0),
        "lead_in": 8.0,
        "workspace": Workspace((40.0, -250.0, 0.0), (330.0, 250.0, 300.0)),
        "world_from_camera": look_at((228.6, -101.6, 50.8), (126.0, -11.0, 36.0)),
        "nominal": nominal,
        "known": KnownIntrinsics(nominal),
        "calibration": CalibrationSettings(),
        "engine": EngineSettings(),
        "massage": MassageSettings(),
        "simulated_devices": ("arm", "camera"),
    }
    return CellSettings(**(values | changes))


def picking_of(settings: CellSettings, world_from_object: Array) -> Picking:
    """Return the marks as a perfect picture would show them."""
    camera_from_object = invert(settings.world_from_camera) @ world_from_object
    pixels = project(settings.nominal, camera_from_object, settings.leg.points())
    pairs = zip(settings.leg.names(), pixels, strict=True)
    return Picking({n: FoundMark(float(u), float(v), 0.05, 1.0, 0.002) for n, (u, v) in pairs})


def calibration_of(settings: CellSettings, world_from_object: Array) -> Calibration:
    """Return what the solver makes of a perfect picture of a leg at a pose."""
    return solve_marks(picking_of(settings, world_from_object), settings, seed=1)


def steps_at(settings: CellSettings, pose: ToolPose) -> Steps:
    """Return the whole absolute steps at a pose."""
    return next(iter(rounded(pose_steps(settings.arm, pose.vector())[None])))


class Mover(Protocol):
    """The part of an arm that procedures use."""

    def read(self) -> ArmReading:
        """Return registers and switch."""

    def step(self, move: StepMove) -> ArmReading:
        """Carry out one motion command."""


@dataclass
class Bench:
    """A simulated arm over a leg, and a performer that does what a procedure yields."""

    settings: CellSettings
    world: World
    arm: Mover
    memory: Memory
    log: list[do.Effect] = field(default_factory=list)
    # Called before each effect; what it returns is thrown into the procedure.
    interrupt: Callable[[do.Effect], Exception | None] = lambda _: None

    def run(self, job: str) -> str:
        """Perform a job to its end and return its outcome."""
        return self.perform(procedure(job, self.settings, self.memory, 0.0))

    def perform(self, work: Generator[do.Effect, Any, str]) -> str:
        """Perform a procedure to its end and return what it returns."""
        try:
            effect = next(work)
            while True:
                thrown = self.interrupt(effect)
                if thrown is not None:
                    effect = work.throw(thrown)
                    continue
                self.log.append(effect)
                effect = work.send(self.result(effect))
        except StopIteration as end:
            return str(end.value)

    def result(self, effect: do.Effect) -> Any:
        """Do one effect."""
        match effect:
            case do.Move():
                assert effect.start == self.memory.steps()
                calibration = self.memory.calibration
                pose = calibration.world_from_object if calibration else None
                envelope.check(self.settings, pose, effect)
                return self.arm.step(effect.move)
            case do.ReadArm():
                return self.arm.read()
            case do.Grab():
                return Frame(np.zeros((576, 768), dtype=np.uint8), 0.0, 1, "test")
            case do.Find():
                return picking_of(self.settings, self.world.world_from_object)
            case do.Solve():
                return calibration_of(self.settings, self.world.world_from_object)
            case _:
                return None

    def entered(self) -> list[str]:
        """Return the states entered, in order, repeats left out."""
        states = [e.state for e in self.log if isinstance(e, do.Enter)]
        return [s for i, s in enumerate(states) if i == 0 or s != states[i - 1]]

    def moves(self) -> list[do.Move]:
        """Return the motion commands that were performed."""
        return [e for e in self.log if isinstance(e, do.Move)]

    def contacts(self) -> list[dict[str, Any]]:
        """Return the contact events."""
        return [dict(e.data) for e in self.log if isinstance(e, do.Record) and e.kind == "contact"]

    def touches(self) -> list[dict[str, Any]]:
        """Return what the world felt."""
        touches: Any = self.world.testimony()["touches"]
        return list(touches)


def make_bench(seed: int = 1, *, sim: dict[str, Any] | None = None, **changes: Any) -> Bench:
    """Return a bench by seed, or with changed settings."""
    settings = cell_settings(**changes)
    world = World(SimSettings(seed=seed, **(sim or {})), settings.leg, settings.arm, ManualClock())
    arm = SimArm(world)
    arm.open()
    memory = Memory(
        reference=steps_at(settings, HOME),
        registers=arm.read().registers,
        calibration=calibration_of(settings, world.world_from_object),
        verified_at=0.0,
    )
    return Bench(settings, world, arm, memory)
