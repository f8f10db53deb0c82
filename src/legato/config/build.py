"""From the configuration's keys (mm, deg) to what the layers take (mm, rad). No decisions here."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from legato.calibration.problem import EngineSettings, KnownIntrinsics
from legato.config.schema import Config, PoseTable
from legato.control.settings import CellSettings, Workspace
from legato.geometry.arm import INCH, ArmLimits, ArmModel
from legato.geometry.leg import Leg
from legato.geometry.motion import ToolPose
from legato.geometry.projection import Intrinsics
from legato.geometry.shapes import Shapes
from legato.geometry.transforms import Array, checked_transform, look_at

if TYPE_CHECKING:
    from legato.config.load import Loaded


def leg(config: Config) -> Leg:
    """Return the leg model of `[leg]`."""
    table = config.leg
    return Leg(
        big_radius=table.big_radius_mm,
        small_radius=table.small_radius_mm,
        length=table.length_mm,
        marks=dict(table.marks),
        mark_size=table.mark_size_mm,
    )


def arm_model(config: Config) -> ArmModel:
    """Return the arm of `[robot]`: lengths, counts, rates, limits and shape."""
    robot = config.robot
    return ArmModel(
        shoulder_height=robot.shoulder_height_mm,
        upper_arm=robot.upper_arm_mm,
        forearm=robot.forearm_mm,
        hand=robot.hand_mm,
        steps_per_rev=robot.steps_per_rev,
        grip_steps_per_mm=robot.grip_steps_per_in / INCH,
        grip_per_elbow=robot.grip_per_elbow,
        roll_sign=robot.roll_sign,
        rates=robot.rates,
        limits=ArmLimits(
            base=_radians(robot.base_deg),
            shoulder=_radians(robot.shoulder_deg),
            elbow=_radians(robot.elbow_deg),
            wrist=_radians(robot.wrist_deg),
            roll=_radians(robot.roll_deg),
        ),
        hand_radius=robot.hand_radius_mm,
        finger_length=robot.finger_length_mm,
        finger_radius=robot.finger_radius_mm,
        forearm_radius=robot.forearm_radius_mm,
        base_radius=robot.base_radius_mm,
    )


def world_from_camera(config: Config) -> Array:
    """Return where the camera stands in the robot base frame, 4x4."""
    cell = config.cell
    if cell.world_from_camera is not None:
        return checked_transform(cell.world_from_camera)
    if cell.camera_at_mm is None or cell.camera_looks_at_mm is None:
        raise ValueError("the configuration was not checked: no camera pose")
    return look_at(cell.camera_at_mm, cell.camera_looks_at_mm)


def nominal_intrinsics(config: Config) -> Intrinsics:
    """Return a guess of the camera for picking: square pixels, principal point in the middle."""
    camera = config.camera
    return Intrinsics(
        alpha_u=camera.nominal_alpha_px,
        alpha_v=camera.nominal_alpha_px,
        u0=(camera.width - 1) / 2,
        v0=(camera.height - 1) / 2,
        width=camera.width,
        height=camera.height,
    )


def engine_settings(config: Config) -> EngineSettings:
    """Return the genetic search's settings of `[calibration]`."""
    table = config.calibration
    return EngineSettings(
        population=table.population,
        generations=table.generations,
        crossover_rate=table.crossover_rate,
        mutation_rate=table.mutation_rate,
    )


def workspace(config: Config) -> Workspace:
    """Return the box of `[cell.workspace]` and the table's height."""
    box = config.cell.workspace
    return Workspace(
        low=(box.x_mm[0], box.y_mm[0], box.z_mm[0]),
        high=(box.x_mm[1], box.y_mm[1], box.z_mm[1]),
        table_z=config.cell.table_z_mm,
    )


def tool_pose(table: PoseTable) -> ToolPose:
    """Return a pose of the fingertip."""
    x, y, z = table.xyz_mm
    pitch, roll = _radians((table.pitch_deg, table.roll_deg))
    return ToolPose(x, y, z, pitch, roll)


def known_intrinsics(loaded: Loaded) -> KnownIntrinsics | None:
    """Return the calibrated camera where the calibration is to use it."""
    if loaded.config.calibration.intrinsics != "known" or loaded.intrinsics is None:
        return None
    return loaded.intrinsics.known()


def _guess(loaded: Loaded) -> Intrinsics:
    """Return the nominal camera, with the lens's distortion where a file tells it."""
    guess = nominal_intrinsics(loaded.config)
    if loaded.intrinsics is None:
        return guess
    return replace(guess, k1=loaded.intrinsics.k1, k2=loaded.intrinsics.k2)


def cell_settings(loaded: Loaded) -> CellSettings:
    """Return all that a procedure is told of the cell."""
    config = loaded.config
    known = known_intrinsics(loaded)
    drivers = (("arm", config.robot.driver), ("camera", config.camera.driver))
    return CellSettings(
        leg=leg(config),
        stations=tuple(config.leg.stations_mm),
        approach=config.leg.approach_mm,
        arm=arm_model(config),
        shapes=Shapes(arm_model(config), leg(config), config.cell.table_z_mm),
        speed_scale=config.robot.speed_scale,
        home=tool_pose(config.robot.home),
        start=tool_pose(config.robot.start),
        lead_in=config.robot.lead_in_mm,
        workspace=workspace(config),
        world_from_camera=world_from_camera(config),
        nominal=known.intrinsics if known is not None else _guess(loaded),
        known=known,
        calibration=config.calibration,
        engine=engine_settings(config),
        massage=config.massage,
        simulated_devices=tuple(name for name, driver in drivers if driver == "sim"),
        camera_dated_s=loaded.intrinsics.dated().timestamp()
        if known and loaded.intrinsics
        else None,
        camera_days=config.camera.max_intrinsics_age_days,
    )


def _radians(degrees: tuple[float, float]) -> tuple[float, float]:
    """Return two angles in rad."""
    low, high = np.radians(degrees)
    return float(low), float(high)
