"""The devices of one cell, chosen by configuration alone."""

import math
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from legato.config.build import arm_model, leg
from legato.config.schema import Config
from legato.geometry.motion import ToolPose
from legato.hal.arm import Arm, Witness
from legato.hal.camera import Camera
from legato.hal.clock import Clock

if TYPE_CHECKING:
    from legato.config.load import Loaded


class WallClock:
    """Real seconds."""

    def monotonic(self) -> float:
        """Return the system's monotonic seconds."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait; not at all where negative."""
        time.sleep(max(seconds, 0.0))


@dataclass(frozen=True)
class Cell:
    """Arm, camera, their clock, and the witness of a simulated world.

    `stands_at` is where a simulated arm stands when it is switched on, since the configuration
    puts it there as a person would; a real arm has none and must be referenced.
    """

    arm: Arm
    camera: Camera
    clock: Clock
    witness: Witness | None = None
    stands_at: ToolPose | None = None


def build_clock(loaded: "Loaded") -> Clock:
    """Return the cell's time: faster than the wall only where arm and camera are simulated."""
    config = loaded.config
    if config.robot.driver == "sim" and config.camera.driver == "sim":
        from legato.drivers.sim.clock import SimClock

        return SimClock(config.sim.time_scale)
    return WallClock()


def build_cell(loaded: "Loaded", clock: Clock | None = None) -> Cell:
    """Return arm and camera as configured, not yet opened. Loads the drivers' libraries."""
    clock = clock if clock is not None else build_clock(loaded)
    return _with_faults(_sound_cell(loaded.config, clock), loaded.config)


def _with_faults(cell: Cell, config: Config) -> Cell:
    """Return a cell whose arm and camera go wrong as `[sim.faults]` says; real ones too.

    The witness stays the world's own: it tells what truly happened.
    """
    faults = config.sim.faults
    if not faults:
        return cell
    from legato.drivers.faulty.arm import faulty_arm
    from legato.drivers.faulty.camera import FaultyCamera

    of_arm = [fault for fault in faults if fault.device == "arm"]
    of_camera = [fault for fault in faults if fault.device == "camera"]
    return replace(
        cell,
        arm=faulty_arm(cell.arm, of_arm, cell.clock) if of_arm else cell.arm,
        camera=FaultyCamera(cell.camera, of_camera, cell.clock) if of_camera else cell.camera,
    )


def _sound_cell(config: Config, clock: Clock) -> Cell:
    """Return arm and camera as the configuration names them."""
    if "sim" not in (config.robot.driver, config.camera.driver):
        return Cell(_real_arm(config, clock), _real_camera(config), clock)
    from legato.drivers.sim.arm import SimArm
    from legato.drivers.sim.camera import SimCamera
    from legato.drivers.sim.world import World

    # One world: the simulated camera sees the leg that the simulated arm touches.
    sim = config.sim
    world = World(sim, leg(config), arm_model(config), clock, config.cell.table_z_mm)
    camera = (
        SimCamera(world, config.camera.width, config.camera.height)
        if config.camera.driver == "sim"
        else _real_camera(config)
    )
    if config.robot.driver != "sim":
        return Cell(_real_arm(config, clock), camera, clock)
    arm = SimArm(world)
    pitch, roll = math.radians(sim.arm_pitch_deg), math.radians(sim.arm_roll_deg)
    return Cell(arm, camera, clock, arm, ToolPose(*sim.arm_at_mm, pitch=pitch, roll=roll))


def _real_arm(config: Config, clock: Clock) -> Arm:
    from legato.drivers.teachmover import TeachMover, TeachMoverSettings

    robot = config.robot
    settings = TeachMoverSettings(
        port=robot.port,
        baud=robot.baud,
        reply_margin_s=robot.reply_margin_s,
        switch_mask=robot.switch_mask,
        switch_active_low=robot.switch_active_low,
    )
    return TeachMover(settings, clock)


def _real_camera(config: Config) -> Camera:
    from legato.drivers.opencv import CameraSettings, OpenCVCamera

    camera = config.camera
    return OpenCVCamera(
        CameraSettings(
            source=camera.source,
            width=camera.width,
            height=camera.height,
            timeout_s=camera.timeout_s,
            max_age_s=camera.max_age_s,
        )
    )
