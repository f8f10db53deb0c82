"""Every arm's driver over the same simulated world, in process and over a line."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from legato.drivers.emulator import Emulator, Faults, PseudoTerminal, fault
from legato.drivers.faulty.arm import faulty_arm
from legato.drivers.sim.arm import SimArm
from legato.drivers.sim.clock import ManualClock, SimClock
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import World
from legato.drivers.teachmover import TeachMover, TeachMoverSettings
from legato.geometry.arm import ArmModel
from legato.geometry.leg import Leg
from legato.geometry.motion import (
    StepMove,
    Steps,
    ToolPose,
    move_between,
    pose_steps,
    rounded,
    straight_path,
)
from legato.hal.arm import Arm, ArmReading
from legato.hal.clock import Clock
from legato.hal.faults import Cause, DeviceError

MODEL, LEG = ArmModel(), Leg()
HOME = ToolPose(127.0, 0.0, 150.0)
MOVE = StepMove((40, 0, 0, 0, 0, 0), 200)
ZERO: Steps = (0, 0, 0, 0, 0, 0)


@dataclass
class Bench:
    """An arm under test, the true world behind it, and what can be done to its line.

    `plugged` can be acquired once each time that the line was plugged in.
    """

    arm: Arm
    world: World
    cut: Callable[[], None] | None = None
    port: str = ""
    plugged: threading.Semaphore = field(default_factory=lambda: threading.Semaphore(0))


def still_world(clock: Clock | None = None) -> World:
    """Return a world whose leg lies where the settings say, and whose clock never waits."""
    true = SimSettings(scatter_mm=0.0, scatter_deg=0.0, backlash_steps=0.0)
    return World(true, LEG, MODEL, clock if clock is not None else ManualClock())


@contextmanager
def simulated() -> Iterator[Bench]:
    """Make the simulated arm in this process."""
    world = still_world()
    yield Bench(SimArm(world), world)


@contextmanager
def wrapped() -> Iterator[Bench]:
    """Wrap the simulated arm in one that could go wrong, and does not."""
    world = still_world()
    yield Bench(faulty_arm(SimArm(world), (), world.clock), world)


@contextmanager
def wrapped_over_a_line() -> Iterator[Bench]:
    """Wrap the TeachMover's driver in the same way."""
    with over_a_line() as made:
        made.arm = faulty_arm(made.arm, (), SimClock())
        yield made


@contextmanager
def over_a_line(
    *faults: str, clock: Clock | None = None, margin_s: float = 3.0, link: Path | None = None
) -> Iterator[Bench]:
    """Put the TeachMover's driver on a pseudo-terminal, by a link to it if one is named."""
    world = still_world(clock)
    far = SimArm(world)
    far.open()
    emulator = Emulator(far, world.clock, faults=Faults(map(fault, faults)))
    plugged = threading.Semaphore(0)

    def opened(path: str) -> None:
        if link is not None:
            link.unlink(missing_ok=True)
            link.symlink_to(path)
        plugged.release()

    with PseudoTerminal(emulator, opened) as line:
        thread = threading.Thread(target=line.serve, name="emulator")
        thread.start()
        port = line.path if link is None else str(link)
        arm = TeachMover(TeachMoverSettings(port=port, reply_margin_s=margin_s), SimClock())

        def cut() -> None:
            line.stop()
            thread.join()
            line.close()

        try:
            yield Bench(arm, world, cut, port, plugged)
        finally:
            arm.close()
            if thread.is_alive():
                cut()


BENCHES = {
    "sim": simulated,
    "teachmover": over_a_line,
    "faulty sim": wrapped,
    "faulty teachmover": wrapped_over_a_line,
}


def cause_of(call: Callable[[], object]) -> Cause:
    """Return the cause that a call raises."""
    with pytest.raises(DeviceError) as caught:
        call()
    return caught.value.cause


def whole(pose: ToolPose) -> Steps:
    """Return a pose's rounded half-steps."""
    return next(iter(rounded(pose_steps(MODEL, pose.vector())[None])))


def go(arm: Arm, start: ToolPose, end: ToolPose) -> ArmReading:
    """Move the fingertip along a straight line and return the last reading."""
    at, reading = whole(start), arm.read()
    for target in rounded(straight_path(MODEL, start, end)):
        reading = arm.step(move_between(MODEL, at, target))
        at = target
    return reading


def answered(arm: Arm) -> ArmReading:
    """Return a reading, asked for until the line has recovered."""
    for _ in range(10):
        try:
            return arm.read()
        except DeviceError:
            continue
    raise AssertionError("the line never recovered")
