"""Six stepper motors as they truly turn: play, lost steps and registers that know of neither.

The shaft is the motor's side of the gear, the output the joint's. The output trails the shaft:
shaft <= output <= shaft + play. Registers count what was asked for, never what happened.
"""

import numpy as np

from legato.geometry.arm import MOTOR_NAMES, ArmModel, joints_from_steps, steps_from_joints
from legato.geometry.motion import StepMove, Steps
from legato.geometry.transforms import Array

# Play lets a joint that was sent to the end of its range swing past it by about this much.
STOP_TOLERANCE = np.radians(1.0)
# After the gripper has closed, 32 more half-steps add one pound of grip (manual).
GRIP_N_PER_STEP = 4.45 / 32.0


class Motors:
    """The motors of one arm that truly stands at `joints` (5,), gripper just closed.

    `play` is the backlash of motors 1 to 5 in half-steps, taken up as if each had last moved
    forward. Arrays of motors are (6,) half-steps from the stretched pose. `lost` counts what each
    motor was sent and did not turn, whichever way.
    """

    def __init__(self, model: ArmModel, joints: Array, play: float) -> None:
        self._model = model
        self._play = np.array([play] * 5 + [0.0])
        self._rates = np.asarray(model.rates)
        self._stops = _stops(model)
        self.shaft = steps_from_joints(model, joints)
        self.output = self.shaft.copy()
        self.registers: Steps = (0, 0, 0, 0, 0, 0)
        self.lost = np.zeros(6)
        self._slipping = np.zeros(6)

    @property
    def joints(self) -> Array:
        """The true joints (5,) now."""
        return joints_from_steps(self._model, self.output)[0]

    @property
    def grip_force(self) -> float:
        """Force of the closed fingers on each other."""
        shut = self._model.grip_per_elbow * self.shaft[2] - self.shaft[5]
        return GRIP_N_PER_STEP * max(0.0, float(shut))

    def slip(self, motor: int, steps: int) -> None:
        """Have a motor (1 to 6) miss the next half-steps that it is sent, whichever way."""
        self._slipping[motor - 1] += steps

    def travel(self, move: StepMove) -> tuple[Array, list[str]]:
        """Return the shafts' travel (6,) and a sentence for each motor asked for too much."""
        asked = np.array(move.steps, dtype=float)
        missed = np.minimum(np.abs(asked), self._slipping)
        self._slipping -= missed
        asked -= np.sign(asked) * missed
        rates = move.rates()
        fast = rates > self._rates * (1.0 + 1e-9)
        if not fast.any():
            return asked, []
        kept = np.where(fast, np.trunc(asked * self._rates / np.maximum(rates, 1e-9)), asked)
        texts = [
            f"motor {m + 1} ({MOTOR_NAMES[m]}) was asked for {rates[m]:.0f} half-steps/s, it "
            f"manages {self._rates[m]:.0f}: {abs(asked[m] - kept[m]):.0f} steps lost"
            for m in np.flatnonzero(fast)
        ]
        return kept, texts

    def outputs(self, travel: Array, fractions: Array) -> Array:
        """Return the outputs (N, 6) when `fractions` (N,) of the shafts' `travel` are done."""
        shaft = self.shaft + fractions[:, None] * travel
        # Right for any one command, since within it no motor turns round.
        return np.clip(self.output, shaft, shaft + self._play)

    def past_stops(self, outputs: Array) -> Array:
        """Return how far (N, 5) outputs (N, 6) lie past the joints' stops, rad; 0 within."""
        j, _ = joints_from_steps(self._model, outputs)
        angles = np.stack(
            [j[:, 0], j[:, 1], j[:, 2] - j[:, 1], j[:, 3] - j[:, 2], j[:, 4]], axis=-1
        )
        low, high = self._stops
        return np.maximum(0.0, np.maximum(low - angles, angles - high))

    def registers_at(self, move: StepMove, fraction: float) -> Steps:
        """Return the registers when a fraction of the command has been sent to the motors."""
        a, b, c, d, e, f = (
            r + round(fraction * s) for r, s in zip(self.registers, move.steps, strict=True)
        )
        return a, b, c, d, e, f

    def settle(self, move: StepMove, travel: Array, fraction: float) -> None:
        """End a command of which the shafts have done a fraction; the registers count it whole."""
        self.output = self.outputs(travel, np.array([fraction]))[0]
        self.shaft = self.shaft + fraction * travel
        self.lost += np.abs(np.array(move.steps) - fraction * travel)
        self.registers = self.registers_at(move, 1.0)

    def zero(self) -> None:
        """Zero the registers; nothing moves."""
        self.registers = (0, 0, 0, 0, 0, 0)


def _stops(model: ArmModel) -> tuple[Array, Array]:
    """Return the joints' low and high mechanical stops (5,) each, rad."""
    lim = model.limits
    pairs = np.array([lim.base, lim.shoulder, lim.elbow, lim.wrist, lim.roll])
    return pairs[:, 0] - STOP_TOLERANCE, pairs[:, 1] + STOP_TOLERANCE
