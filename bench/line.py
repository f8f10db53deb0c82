"""What the line to the arm costs: steps simulated and sent, their floor, kinematics, parsers.

The floor of a step is its motion and the line's own time of every character of STEP and READ.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from statistics import fmean

import numpy as np

from bench.row import Row, keep
from legato.config.build import arm_model, leg
from legato.config.load import load
from legato.daemon.cell import WallClock
from legato.drivers.sim.arm import SimArm
from legato.drivers.sim.clock import ManualClock
from legato.drivers.sim.world import World
from legato.drivers.teachmover import TeachMover, TeachMoverSettings
from legato.geometry.arm import ArmModel, backward, forward
from legato.geometry.leg import Leg
from legato.geometry.motion import StepMove, ToolPose, move_between, pose_steps, rounded
from legato.geometry.transforms import apply
from legato.wire.teachmover import Read, Registers, ReplyParser, Step, encode
from legato.wire.teachmover_robot import CommandParser, encode_reply

BAUD = 9600
BITS = 10
RATIO = 1.25  # the aim for a whole set of passes; a single step has to stay well within
POSES = 200_000
LEAST_POSES_S = 200_000.0
ROUND_TRIP = 1e-9
STEPS = 60
MOVES = {
    "guarded step": StepMove((0, 4, 2, 0, 0, 2), 223),
    "transit": StepMove((67, -1, 6, 14, -19, 6), 228),
}


def run() -> list[Row]:
    """Return the figures of the simulated arm, the line, the kinematics and the parsers."""
    rows = [*simulated(), *line(), *kinematics(), *parsers()]
    keep("line", rows)
    return rows


def simulated() -> Iterator[Row]:
    """Yield what one step of the simulated arm costs the computer, free and on the leg."""
    config = load().config
    world = World(config.sim, leg(config), arm_model(config), ManualClock())
    arm = SimArm(world)
    arm.open()
    yield Row("line: SimArm.step, transit", 1e3 * seconds_a_step(arm, MOVES["transit"]), "ms")
    press(arm, world, arm_model(config))
    yield Row("line: SimArm.step, on the leg", 1e3 * seconds_a_step(arm, MOVES["guarded step"]),
              "ms")  # fmt: skip


def press(arm: SimArm, world: World, model: ArmModel) -> None:
    """Bring the fingertip onto the leg at 67 mm, from above."""
    at = rounded_pose(model, ToolPose(*world.settings.arm_at_mm))
    x, y, z = apply(world.world_from_object, Leg().surface_point([67.0]))[0]
    for pose in (ToolPose(x, y, z + 20.0), ToolPose(x, y, z - 1.0)):
        target = rounded_pose(model, pose)
        arm.step(move_between(model, at, target))
        at = target


def rounded_pose(model: ArmModel, pose: ToolPose) -> tuple[int, int, int, int, int, int]:
    """Return a pose's whole half-steps."""
    return next(rounded(pose_steps(model, pose.vector())[None]))


def seconds_a_step(arm: SimArm, move: StepMove) -> float:
    """Return the mean wall time of a step forth and back."""
    a, b, c, d, e, f = (-s for s in move.steps)
    back = StepMove((a, b, c, d, e, f), move.speed)
    return clocked(lambda: (arm.step(move), arm.step(back))) / 2.0


def clocked(work: Callable[[], object], least_s: float = 0.3) -> float:
    """Return the mean wall time of a piece of work that is done again and again."""
    work()
    count, began = 0, time.perf_counter()
    while (spent := time.perf_counter() - began) < least_s:
        work()
        count += 1
    return spent / count


def line() -> Iterator[Row]:
    """Yield each kind of step over the emulated line in true time, over its floor."""
    with emulated() as port:
        arm = TeachMover(TeachMoverSettings(port=port), WallClock())
        arm.open()
        for name, move in MOVES.items():
            times, floors = [], []
            for number in range(STEPS):
                sign = 1 if number % 2 == 0 else -1
                a, b, c, d, e, f = (sign * s for s in move.steps)
                sent = StepMove((a, b, c, d, e, f), move.speed)
                began = time.perf_counter()
                reading = arm.step(sent)
                times.append(time.perf_counter() - began)
                floors.append(floor(sent, Registers(reading.registers, reading.inputs)))
            took, least = fmean(times), fmean(floors)
            yield Row(f"line: STEP and READ at {BAUD} baud, {name}", 1e3 * took, "ms",
                      peer=1e3 * least)  # fmt: skip
            yield Row(f"line: the same over its floor, {name}", took / least, "", RATIO)
        arm.close()


def floor(move: StepMove, registers: Registers) -> float:
    """Return the least time of a step and a read: the motion and every character's own time."""
    said = len(encode(Step(move))) + len(b"1\r") + len(encode(Read()))
    return move.duration + (said + len(encode_reply(registers))) * BITS / BAUD


@contextmanager
def emulated() -> Iterator[str]:
    """Give the port of an emulator in a process of its own, in true time."""
    command = [sys.executable, "-m", "legato", "emulate", "--json", "--baud", str(BAUD)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        try:
            assert process.stdout is not None
            yield str(json.loads(process.stdout.readline())["port"])
        finally:
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=10.0)


def kinematics() -> Iterator[Row]:
    """Yield how fast poses become joints, and how far there and back leads astray."""
    model, rng = ArmModel(), np.random.default_rng(0)
    base, shoulder = rng.uniform(-1.5, 1.5, POSES), rng.uniform(-0.5, 2.0, POSES)
    elbow = shoulder - rng.uniform(0.05, 2.5, POSES)
    pitch, roll = rng.uniform(-1.6, 1.6, POSES), rng.uniform(-3.0, 3.0, POSES)
    joints = np.stack([base, shoulder, elbow, pitch, roll], axis=-1)
    ahead = forward(model, joints * [0, 1, 1, 1, 1])[0][:, 0] > 1.0  # not over the arm's own back
    place, pitch, roll = forward(model, joints[ahead])
    spent = clocked(lambda: backward(model, place, pitch, roll))
    yield Row("line: backward solution", len(place) / spent, "/s", LEAST_POSES_S, at_least=True)
    again = forward(model, backward(model, place, pitch, roll))
    astray = max(float(np.abs(a - b).max()) for a, b in zip(again, (place, pitch, roll),
                                                            strict=True))  # fmt: skip
    yield Row("line: round trip of the fingertip", astray, "mm", ROUND_TRIP)


def parsers() -> Iterator[Row]:
    """Yield how many bytes a second the parsers take, beside what the line can bring."""
    commands = encode(Step(MOVES["transit"])) + encode(Read())
    replies = encode_reply(Registers((1000, -2000, 3000, -400, 500, -6), 128))

    def host() -> None:
        parser = ReplyParser()
        for _ in range(200):
            parser.expect(Read())
            parser.receive(replies)
            assert isinstance(parser.next_event(), Registers)

    def robot() -> None:
        parser = CommandParser()
        for _ in range(100):
            parser.receive(commands)
            assert len(list(parser.events())) == 2

    peer = BAUD / BITS
    yield Row("line: replies parsed", 200 * len(replies) / clocked(host), "B/s", peer=peer)
    yield Row("line: commands parsed", 100 * len(commands) / clocked(robot), "B/s", peer=peer)
