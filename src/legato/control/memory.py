"""What outlives a job: where the arm stands and what is known of the leg. One thread owns it."""

from dataclasses import dataclass

from legato.control.perceive import Calibration, Picks
from legato.geometry.motion import Steps
from legato.hal.camera import Frame


@dataclass
class Memory:
    """The cell's knowledge between jobs; None where nothing is known.

    `reference` is the absolute steps (geometry.arm) at which the registers read zero.
    `picks` are the marks that a person named for the leg as it lies.
    """

    reference: Steps | None = None
    registers: Steps | None = None
    frame: Frame | None = None
    calibration: Calibration | None = None
    verified_at: float | None = None
    picks: Picks | None = None

    def steps(self) -> Steps | None:
        """Return where the arm stands in absolute steps, if that is known."""
        if self.reference is None or self.registers is None:
            return None
        return absolute(self.reference, self.registers)


def absolute(reference: Steps, registers: Steps) -> Steps:
    """Return absolute steps of register counts."""
    one, two, three, four, five, six = (a + b for a, b in zip(reference, registers, strict=True))
    return one, two, three, four, five, six
