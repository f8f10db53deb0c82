"""An emulator over an arm that only notes what it is told."""

from legato.drivers.emulator import Emulator, Faults, fault
from legato.drivers.sim.clock import ManualClock
from legato.geometry.motion import StepMove, Steps
from legato.hal.arm import ArmReading
from legato.hal.faults import DeviceError

CHARACTER = 10 / 9600
STEP = b"@STEP 100,10,0,0,0,0,-100\r"
ZERO_READ = b"1\r0,0,0,0,0,0,0\r"


class RecordingArm:
    """An arm that counts its commands' steps; contact from a number of commands on."""

    simulated = True
    position_in_doubt = False

    def __init__(self) -> None:
        self.moves: list[StepMove] = []
        self.slips: list[tuple[int, int]] = []
        self.registers: Steps = (0, 0, 0, 0, 0, 0)
        self.contact = False
        self.shut_after = 10**6
        self.error: DeviceError | None = None

    def open(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def read(self) -> ArmReading:
        """Return the counts and what the test set."""
        return ArmReading(self.registers, self.contact or len(self.moves) >= self.shut_after)

    def step(self, move: StepMove) -> ArmReading:
        """Remember and count."""
        if self.error is not None:
            raise self.error
        self.moves.append(move)
        a, b, c, d, e, f = (r + s for r, s in zip(self.registers, move.steps, strict=True))
        self.registers = (a, b, c, d, e, f)
        return self.read()

    def zero(self) -> None:
        """Zero."""
        self.registers = (0, 0, 0, 0, 0, 0)

    def slip(self, motor: int, steps: int) -> None:
        """Remember."""
        self.slips.append((motor, steps))


def robot(*faults: str, seed: int = 0) -> tuple[Emulator, RecordingArm, ManualClock]:
    """Return an emulator with these faults on a line without delay, its arm and its clock."""
    arm, clock = RecordingArm(), ManualClock()
    return Emulator(arm, clock, faults=Faults(map(fault, faults), seed)), arm, clock
