"""An arm as the daemon sees it: half-steps in, registers and a grip switch out."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from legato.geometry.motion import StepMove, Steps


@dataclass(frozen=True)
class ArmReading:
    """Position registers since they were last zeroed, the grip switch, and the raw input word."""

    registers: Steps
    contact: bool
    inputs: int = 0


@runtime_checkable
class Arm(Protocol):
    """One arm. Every call ends within its own time-out or raises DeviceError.

    Calls are idempotent where that means something: opening an open arm or closing a closed one
    does nothing. One call at a time; the driver holds no thread that moves the arm.
    """

    @property
    def simulated(self) -> bool:
        """Whether no real arm moves."""

    @property
    def position_in_doubt(self) -> bool:
        """Whether registers and arm may disagree, from a broken-off motion until `zero`."""

    def open(self) -> None:
        """Connect, and see that the arm answers. Moves nothing."""

    def close(self) -> None:
        """Let go of the port in any state. Never raises for a device that has vanished."""

    def read(self) -> ArmReading:
        """Return registers and switch now."""

    def step(self, move: StepMove) -> ArmReading:
        """Carry out one motion command to its end, then return registers and switch."""

    def zero(self) -> None:
        """Zero the position registers where the arm stands. Motor current may drop."""


@runtime_checkable
class Traced(Protocol):
    """A driver that remembers what passed on its line. Only evidence of faults asks it."""

    @property
    def last_bytes(self) -> tuple[str, ...]:
        """The last chunks on the line as text, oldest first."""


@runtime_checkable
class Witness(Protocol):
    """A simulated world that can say afterwards what truly happened. Only records ask it."""

    def testimony(self) -> dict[str, object]:
        """Return the true poses, touches and breaches since the start, as JSON-able data."""
