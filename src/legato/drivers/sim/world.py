"""One simulated world: a leg on a table, and an arm that truly moves, touches and loses steps.

The arm learns of the leg through contact alone, the camera through its picture alone. Breaches
are: `rate` (a motor asked for more than it manages), `limit` (a joint against its stop), `stall`
(a push beyond the motors' strength), `touch` (any part but the fingertip meets leg, table, base).
"""

import numpy as np

from legato.drivers.sim.ledger import Contact, Ledger, Walk
from legato.drivers.sim.motors import Motors
from legato.drivers.sim.settings import SimSettings
from legato.geometry.arm import (
    ArmModel,
    forward,
    joints_from_steps,
    reach,
    skeleton,
)
from legato.geometry.leg import Leg
from legato.geometry.motion import StepMove, Steps
from legato.geometry.shapes import OBSTACLES, PARTS, Shapes
from legato.geometry.transforms import (
    Array,
    apply,
    checked_transform,
    invert,
    look_at,
    rotation_from_vector,
    transform,
)
from legato.hal.clock import Clock

FINE = 0.1  # mm of travel between samples where the fingertip may touch
COARSE = 2.0  # mm of travel between samples where other parts may


class World:
    """The truth about one cell; `settings.seed` alone decides what is drawn.

    `marks_rng` and `noise_rng` are for the camera that looks at this world. Lengths in mm, times
    in the clock's seconds. Raises geometry.arm.Unreachable for a start the arm cannot take.
    """

    def __init__(
        self,
        settings: SimSettings,
        leg: Leg,
        model: ArmModel,
        clock: Clock,
        table_z: float = 0.0,
    ) -> None:
        pose, marks, noise = np.random.SeedSequence(settings.seed).spawn(3)
        self.settings = settings
        self.leg = leg
        self.model = model
        self.clock = clock
        self.table_z = table_z
        self.marks_rng = np.random.default_rng(marks)
        self.noise_rng = np.random.default_rng(noise)
        self.world_from_camera = look_at(settings.camera_at_mm, settings.camera_looks_at_mm)
        self._ledger = Ledger()
        self._on_leg = Contact("leg", settings.tissue_n_per_mm, settings.switch_n)
        self._on_table = Contact("table", settings.table_n_per_mm, settings.switch_n)
        self._shapes = Shapes(model, leg, table_z)
        self._motors = Motors(model, _start_joints(settings, model), settings.backlash_steps)
        self._force = 0.0
        self.place_leg(drawn_pose(settings, np.random.default_rng(pose)))

    def place_leg(self, world_from_object: Array) -> None:
        """Put the leg somewhere else, as a careless hand would; the next move feels it there."""
        self.world_from_object = checked_transform(world_from_object)
        self._object_from_world = invert(self.world_from_object)
        # Lower bounds of what fingertip and other parts can travel before they touch anything.
        self._tip_gap = 0.0
        self._body_gap = 0.0
        self._grazing: set[tuple[int, int]] = set()

    @property
    def registers(self) -> Steps:
        """The arm's position registers."""
        return self._motors.registers

    @property
    def switch_closed(self) -> bool:
        """Whether the grip switch is closed, by a push on the fingertip or by the grip itself."""
        return max(self._force, self._motors.grip_force) >= self.settings.switch_n

    def zero(self) -> None:
        """Zero the arm's registers."""
        self._motors.zero()

    def slip(self, motor: int, steps: int) -> None:
        """Have a motor (1 to 6) miss its next half-steps, as a hand in the way would."""
        self._motors.slip(motor, steps)

    def step(self, move: StepMove) -> None:
        """Carry out one motion command and let its time pass."""
        began = self.clock.monotonic()
        travel, lost = self._motors.travel(move)
        for text in lost:
            self._breach("rate", text, began)
        upto = self._until_stop(travel, began)
        bound = upto * self._longest_travel(travel)
        if bound < self._tip_gap:
            self._tip_gap -= bound
            self._force = 0.0
        else:
            upto = self._feel(move, travel, upto, bound, began)
        if bound < self._body_gap:
            self._body_gap -= bound
        else:
            self._graze(move, travel, upto, bound, began)
        self._motors.settle(move, travel, upto)
        # The time that the computing took is part of the motion's.
        self.clock.sleep(began + move.duration - self.clock.monotonic())

    def testimony(self) -> dict[str, object]:
        """Return true poses, touches, breaches and the tip's place now, as JSON-able data."""
        tip, pitch, roll = forward(self.model, self._motors.joints)
        touches = sorted([*self._on_leg.touches, *self._on_table.touches], key=lambda t: t.began_s)
        return {
            "world_from_object": self.world_from_object.tolist(),
            "world_from_camera": self.world_from_camera.tolist(),
            "touches": [t.as_json() for t in touches],
            "breaches": list(self._ledger.breaches),
            "tip": {
                "xyz_mm": tip.tolist(),
                "pitch_deg": float(np.degrees(pitch)),
                "roll_deg": float(np.degrees(roll)),
            },
            "registers": list(self.registers),
            "lost_steps": [round(float(n), 1) for n in self._motors.lost],
        }

    def _breach(self, kind: str, what: str, when: float) -> None:
        """Keep a breach that happens where the fingertip stands."""
        self._ledger.breach(kind, what, forward(self.model, self._motors.joints)[0], when)

    def _until_stop(self, travel: Array, began: float) -> float:
        """Return the fraction of a travel after which a joint's stop holds the arm, at most 1."""
        past = self._motors.past_stops(self._motors.outputs(travel, np.array([0.0, 1.0])))
        if not (past[1] > past[0]).any():
            return 1.0
        fractions = np.linspace(0.0, 1.0, 257)
        past = self._motors.past_stops(self._motors.outputs(travel, fractions))
        beyond = past > past[0]
        joint = int(np.argmax(beyond.any(axis=0)))
        name = ("base", "shoulder", "elbow", "wrist", "roll")[joint]
        self._breach("limit", f"{name} ran against its stop and lost steps", began)
        return float(fractions[max(int(np.argmax(beyond.any(axis=1))) - 1, 0)])

    def _longest_travel(self, travel: Array) -> float:
        """Return an upper bound of how far any point of the arm can go during a travel."""
        base, shoulder, elbow, right, left = np.abs(travel[:5]) / self.model.steps_per_rad
        m = self.model
        fold = m.upper_arm * shoulder + m.forearm * elbow + m.hand * (right + left) / 2.0
        points = skeleton(m, self._motors.joints)
        return float(fold + base * (np.hypot(points[:, 0], points[:, 1]).max() + fold))

    def _walk(
        self, move: StepMove, travel: Array, upto: float, count: int, began: float
    ) -> tuple[Walk, Array]:
        """Return `count` samples of a travel up to a fraction, and their skeletons (N, 4, 3)."""
        fractions = np.linspace(0.0, upto, count)
        joints, _ = joints_from_steps(self.model, self._motors.outputs(travel, fractions))
        skeletons = skeleton(self.model, joints)
        times = began + fractions * move.duration
        sent = self._motors.registers_at
        walk = Walk(fractions, times, skeletons[:, 3], lambda f: sent(move, f))
        return walk, skeletons

    def _feel(
        self, move: StepMove, travel: Array, upto: float, bound: float, began: float
    ) -> float:
        """Walk the fingertip along leg and table; return the fraction at which the arm ends."""
        count = 2 + int(np.ceil(bound / FINE))
        walk, _ = self._walk(move, travel, upto, count, began)
        leg = self.leg.clearance(apply(self._object_from_world, walk.tips))
        table = walk.tips[:, 2] - self.table_z
        forces = self._on_leg.forces(leg) + self._on_table.forces(table)
        harder = (forces[1:] >= self.settings.stall_n) & (forces[1:] > forces[:-1] + 1e-9)
        end = count
        if harder.any():
            end = 1 + int(np.argmax(harder))
            push = f"a push of {self.settings.stall_n:g} N stalled the motors"
            where = walk.tips[end - 1]
            self._ledger.breach("stall", push, where, float(walk.times[end - 1]))
        cut = Walk(walk.fractions[:end], walk.times[:end], walk.tips[:end], walk.registers)
        self._on_leg.follow(cut, leg[:end], self._object_from_world)
        self._on_table.follow(cut, table[:end], self._object_from_world)
        self._force = float(forces[end - 1])
        self._tip_gap = max(0.0, float(min(leg[end - 1], table[end - 1])))
        return float(walk.fractions[end - 1])

    def _graze(
        self, move: StepMove, travel: Array, upto: float, bound: float, began: float
    ) -> None:
        """Note where forearm, hand or finger begin to meet leg, table or base."""
        walk, skeletons = self._walk(move, travel, upto, 2 + int(np.ceil(bound / COARSE)), began)
        gaps = self._shapes.clearance(skeletons, self._object_from_world)
        for part, obstacle in np.argwhere((gaps < 0.0).any(axis=0)):
            pair = int(part), int(obstacle)
            if pair in self._grazing:
                continue
            index = int(np.argmax(gaps[:, part, obstacle] < 0.0))
            depth = -float(gaps[:, part, obstacle].min())
            self._ledger.breach(
                "touch",
                f"{PARTS[part]} meets {OBSTACLES[obstacle]}, {depth:.1f} mm deep",
                self._shapes.deepest(skeletons[index], *pair, self._object_from_world),
                float(walk.times[index]),
            )
        self._grazing = {(int(p), int(o)) for p, o in np.argwhere(gaps[-1] < 0.0)}
        self._body_gap = max(0.0, float(gaps[-1].min()))


def drawn_pose(settings: SimSettings, rng: np.random.Generator) -> Array:
    """Draw world_from_object (4x4): uniform about the configured pose, each coordinate by itself.

    x and y within scatter_mm, z within a third of it; yaw within scatter_deg, rise and roll
    within a half of it.
    """
    mm, deg = settings.scatter_mm, settings.scatter_deg
    shift = rng.uniform(-1.0, 1.0, 3) * [mm, mm, mm / 3.0]
    turn = rng.uniform(-1.0, 1.0, 3) * [deg, deg / 2.0, deg / 2.0]
    placed = np.array([settings.leg_yaw_deg, settings.leg_rise_deg, settings.leg_roll_deg])
    yaw, rise, roll = np.radians(placed + turn)
    about_z = rotation_from_vector([0.0, 0.0, yaw])
    about_y = rotation_from_vector([0.0, -rise, 0.0])
    about_x = rotation_from_vector([roll, 0.0, 0.0])
    return transform(about_z @ about_y @ about_x, np.asarray(settings.leg_at_mm) + shift)


def _start_joints(settings: SimSettings, model: ArmModel) -> Array:
    """Return the joints (5,) at which the arm truly stands when the cell is switched on."""
    pitch, roll = np.radians([settings.arm_pitch_deg, settings.arm_roll_deg])
    return reach(model, settings.arm_at_mm, float(pitch), float(roll))
