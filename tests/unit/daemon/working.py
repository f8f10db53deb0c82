"""Procedures for a worker on a bench."""

from collections.abc import Callable

from legato.control.effects import Enter
from legato.control.memory import Memory
from legato.geometry.motion import Steps
from legato.hal.faults import Cause, DeviceError
from tests.unit.daemon.bench import Work, turn

GONE = DeviceError(Cause.ARM_LOST, "no answer", "plug it in")


def after(memory: Memory) -> Steps:
    """Return where the arm stands."""
    steps = memory.steps()
    assert steps is not None
    return steps


def moving(count: int) -> Callable[[Memory], Work]:
    """Return a procedure of some motions."""

    def work(memory: Memory) -> Work:
        yield Enter("move_home")
        for _ in range(count):
            memory.registers = (yield turn(after(memory))).registers
        return "done"

    return work
