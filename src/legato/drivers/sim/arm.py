"""The simulated arm: it tells registers and the grip switch, and nothing of the true world."""

from legato.drivers.sim.world import World
from legato.geometry.motion import StepMove
from legato.hal.arm import ArmReading
from legato.hal.faults import Cause, DeviceError


class SimArm:
    """An arm in a simulated world; as a Witness it says afterwards what truly happened."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._open = False

    @property
    def simulated(self) -> bool:
        """True: no real arm moves."""
        return True

    @property
    def position_in_doubt(self) -> bool:
        """False: a command of this arm is never broken off."""
        return False

    def open(self) -> None:
        """Connect; the registers are those of the world, zero when it is new."""
        self._open = True

    def close(self) -> None:
        """Let go of the arm; it keeps its registers."""
        self._open = False

    def read(self) -> ArmReading:
        """Return registers and switch now. Raises DeviceError (arm_lost) when not open."""
        self._needs_open()
        return ArmReading(self._world.registers, self._world.switch_closed)

    def step(self, move: StepMove) -> ArmReading:
        """Carry out one motion command to its end, then return registers and switch."""
        self._needs_open()
        self._world.step(move)
        return self.read()

    def zero(self) -> None:
        """Zero the position registers where the arm stands."""
        self._needs_open()
        self._world.zero()

    def slip(self, motor: int, steps: int) -> None:
        """Have a motor (1 to 6) miss its next half-steps; its register will count them."""
        self._world.slip(motor, steps)

    def testimony(self) -> dict[str, object]:
        """Return the world's truth; in any state, since records ask after the arm was closed."""
        return self._world.testimony()

    def _needs_open(self) -> None:
        """Raise where the arm was not opened."""
        if not self._open:
            raise DeviceError(
                Cause.ARM_LOST, "the simulated arm is not open", "open it before it is used"
            )
