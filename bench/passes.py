"""The passes: where the fingertip truly touches, over many leg poses, and how long they take.

The arm is the simulated one behind a line of 9600 baud whose time passes on the cell's clock:
every @STEP and @READ costs its characters, and the reply comes after the motion.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bench.row import Row, keep
from legato.control import effects as do
from legato.control.perceive import Calibration
from legato.control.rehearsal import dry_run
from legato.control.settings import CellSettings
from legato.geometry.arm import ArmModel, forward, joints_from_steps
from legato.geometry.motion import StepMove
from legato.geometry.transforms import Array, apply, rotation_from_vector, transform
from legato.hal.arm import ArmReading
from legato.hal.clock import Clock
from legato.wire.teachmover import Read, Registers, Step, encode
from legato.wire.teachmover_robot import encode_reply
from tests.unit.control.cell import Bench, Mover, make_bench

POSES = 100
BACKLASH = 6.0
CHARACTER_S = 10.0 / 9600.0
PLACES = ([90.0, -170.0, 28.0], [290.0, 50.0, 60.0])
"""Of the big face's centre: beyond what the arm reaches in every direction but up and down."""


@dataclass
class LinedArm:
    """An arm whose commands and replies take the time of a serial line."""

    arm: Mover
    clock: Clock
    line_s: float = 0.0
    readings: list[ArmReading] = field(default_factory=list)

    def read(self) -> ArmReading:
        """Read over the line."""
        reading = self.arm.read()
        said = encode_reply(Registers(reading.registers, reading.inputs))
        self._wait(len(encode(Read())) + len(said))
        return reading

    def step(self, move: StepMove) -> ArmReading:
        """Step, then read, over the line."""
        self._wait(len(encode(Step(move))) + 2)
        self.arm.step(move)
        self.readings.append(self.read())
        return self.readings[-1]

    def _wait(self, characters: int) -> None:
        self.line_s += characters * CHARACTER_S
        self.clock.sleep(characters * CHARACTER_S)


def run() -> list[Row]:
    """Return where the touches lie over many poses, and the time of a set of passes."""
    rng = np.random.default_rng(1)
    runs: list[dict[str, Any]] = []
    refused: list[str] = []
    while len(runs) < POSES:
        result = massage(drawn(rng), seed=len(runs))
        if isinstance(result, dict):
            runs.append(result)
        else:
            refused += result
    unnamed = [r for r in refused if not r.startswith(("station ", "the way home"))]
    errors = np.array([e for r in runs for e in r["errors"]])
    chords = np.concatenate([r["chord"] for r in runs])
    rows = [
        Row("passes: reachable poses not massaged to the end", sum(map(_failed, runs)), "", 0),
        Row("passes: refusals that do not name their station", len(unnamed), "", 0),
        Row("passes: touch off its station, rms", rms(errors), "mm", 0.5),
        Row("passes: touch off its station, worst", float(errors.max()), "mm", 1.0),
        Row("passes: touches elsewhere, rates, limits", sum(r["bad"] for r in runs), "", 0),
        Row("passes: time over its floor, worst", max(r["ratio"] for r in runs), "", 1.25),
        Row("passes: a set of passes, median", median([r["seconds"] for r in runs]), "s"),
        Row("passes: share of time the line is busy", median([r["busy"] for r in runs]), ""),
        Row("passes: chord error, worst", float(chords.max()), "mm", 0.25),
        Row("passes: chord error, rms", rms(chords), "mm"),
        Row("passes: commands a pass", median([r["commands"] / 4 for r in runs]), ""),
    ]
    keep("passes", rows, poses=POSES, backlash_steps=BACKLASH, refused=refused)
    return rows


def drawn(rng: np.random.Generator) -> Array:
    """Draw world_from_object: anywhere the arm might reach, yaw +-25, rise and roll +-6 deg."""
    x, y, z = rng.uniform(*PLACES)
    yaw, rise, roll = np.radians(np.array([90.0, 5.75, 0.0]) + rng.uniform(-1, 1, 3) * [25, 6, 6])
    turns = [[0.0, 0.0, yaw], [0.0, -rise, 0.0], [roll, 0.0, 0.0]]
    about_z, about_y, about_x = (rotation_from_vector(t) for t in turns)
    return transform(about_z @ about_y @ about_x, [x, y, z])


def massage(pose: Array, seed: int) -> dict[str, Any] | list[str]:
    """Return one massage's touches, breaches, time and floor, or why verify refuses the pose.

    The arm is told the true pose: what is measured here is the motion.
    """
    bench = make_bench(seed, sim={"backlash_steps": BACKLASH}, speed_scale=1.0)
    bench.world.place_leg(pose)
    calibration = bench.memory.calibration
    assert calibration is not None
    bench.memory.calibration = told(calibration, bench.settings, pose)
    problems = dry_run(bench.memory.calibration, bench.settings)
    if problems:
        return problems
    lined = LinedArm(bench.arm, bench.world.clock)
    bench.arm = lined
    began = bench.world.clock.monotonic()
    outcome = bench.run("massage")
    dwell = sum(e.seconds for e in bench.log if isinstance(e, do.Dwell))
    seconds = bench.world.clock.monotonic() - began + dwell
    testimony: Any = bench.world.testimony()
    pairs = zip(testimony["touches"], bench.contacts(), strict=True)
    return {
        "outcome": outcome,
        "errors": [off(bench, touch, contact) for touch, contact in pairs],
        "bad": len(testimony["breaches"]),
        "seconds": seconds,
        "ratio": seconds / (floor(bench) + dwell),
        "busy": lined.line_s / seconds,
        "chord": chord(bench),
        "commands": len(bench.moves()),
    }


def told(calibration: Calibration, settings: CellSettings, pose: Array) -> Calibration:
    """Return a calibration that states another pose."""
    places = settings.leg.surface_point(np.array(settings.stations))
    normals = np.tile(pose[:3, :3] @ settings.leg.surface_normal(), (len(places), 1))
    return replace(
        calibration, world_from_object=pose, stations=apply(pose, places), normals=normals
    )


def off(bench: Bench, touch: dict[str, Any], contact: dict[str, Any]) -> float:
    """Return the distance of a touch from its station on the true leg."""
    station = bench.settings.leg.surface_point(np.array(contact["station_mm"]))
    return float(np.linalg.norm(np.array(touch["object_mm"]) - station))


def floor(bench: Bench) -> float:
    """Return the least time without dwell: free motion at full rates, guarded steps' line."""
    return least_time([m.move for m in bench.moves()], [m.why for m in bench.moves()])


def least_time(moves: list[StepMove], whys: Sequence[str]) -> float:
    """Return the floor of some motion commands: see `floor`."""
    rates = np.asarray(ArmModel().rates)
    both = list(zip(moves, whys, strict=True))
    motion = sum(float((np.abs(m.steps) / rates).max()) for m, w in both if w != do.Why.DESCEND)
    reply = len(encode_reply(Registers((-500, -1000, 900, 300, 300, 900), 0)))
    guarded = [m for m, w in both if w == do.Why.DESCEND]
    line = sum(len(encode(Step(m))) + 2 + len(encode(Read())) + reply for m in guarded)
    return motion + line * CHARACTER_S


def _failed(run: dict[str, Any]) -> bool:
    return bool(run["outcome"] != "done")


def chord(bench: Bench) -> Array:
    """Return how far halfway of each command the fingertip is from its straight piece, in mm."""
    return chords(bench.settings.arm, np.array([[m.start, m.target] for m in bench.moves()]))


def chords(model: ArmModel, ends: Array) -> Array:
    """Return the distances (N,) for the steps (N, 2, 6) at which commands start and end."""
    ends = np.asarray(ends, dtype=float)
    points = np.stack([ends[:, 0], ends.mean(axis=1), ends[:, 1]], axis=1)
    joints, _ = joints_from_steps(model, points)
    a, half, b = np.moveaxis(forward(model, joints)[0], 1, 0)
    return np.asarray(np.linalg.norm(half - (a + b) / 2.0, axis=1))


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def median(values: list[float]) -> float:
    """Return the median."""
    return float(np.median(values))
