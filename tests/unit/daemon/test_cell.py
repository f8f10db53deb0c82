"""The cell: drivers by configuration alone, one world for a simulated arm and camera."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import pytest
from msgspec import structs

from legato.config.build import cell_settings
from legato.config.load import Loaded
from legato.config.schema import CameraTable, CellTable, Config, RobotTable, SimTable
from legato.daemon.cell import WallClock, build_cell, build_clock
from legato.drivers.faulty.arm import FaultyArm, FaultyTracedArm, FaultyWitnessArm
from legato.drivers.faulty.camera import FaultyCamera
from legato.drivers.faulty.settings import FaultSettings
from legato.drivers.opencv import OpenCVCamera
from legato.drivers.sim.arm import SimArm
from legato.drivers.sim.camera import SimCamera
from legato.drivers.sim.clock import SimClock
from legato.drivers.teachmover import TeachMover

CELL = CellTable(camera_at_mm=(228.6, -101.6, 50.8), camera_looks_at_mm=(126.0, -11.0, 36.0))


def loaded(robot: Literal["sim", "teachmover"], camera: Literal["sim", "opencv"]) -> Loaded:
    """Return a configuration with these drivers."""
    config = Config(cell=CELL, robot=RobotTable(driver=robot), camera=CameraTable(driver=camera))
    return Loaded(config, Path("cell.toml"), "hash", {})


@pytest.mark.parametrize(
    ("robot", "camera", "arm_type", "camera_type", "clock"),
    [
        ("sim", "sim", SimArm, SimCamera, SimClock),
        ("sim", "opencv", SimArm, OpenCVCamera, WallClock),
        ("teachmover", "sim", TeachMover, SimCamera, WallClock),
        ("teachmover", "opencv", TeachMover, OpenCVCamera, WallClock),
    ],
)
def test_drivers_follow_the_configuration(
    robot: Any, camera: Any, arm_type: type, camera_type: type, clock: type
) -> None:
    """Each pair of drivers is built; nothing is opened; only a simulated world has a witness."""
    cell = build_cell(loaded(robot, camera))
    assert (type(cell.arm), type(cell.camera), type(cell.clock)) == (arm_type, camera_type, clock)
    assert (cell.witness is not None) == (robot == "sim")
    assert (cell.stands_at is not None) == (robot == "sim")
    told = cell_settings(loaded(robot, camera))
    assert ("arm" in told.simulated_devices) == (robot == "sim")
    assert ("camera" in told.simulated_devices) == (camera == "sim")
    assert told.simulated == ("sim" in (robot, camera))


@pytest.mark.parametrize(
    ("robot", "arm_type"), [("sim", FaultyWitnessArm), ("teachmover", FaultyTracedArm)]
)
def test_faults_strike_whatever_drivers_there_are(robot: Any, arm_type: type[FaultyArm]) -> None:
    """Only the device that a fault is of is wrapped, and the witness stays the world's own."""
    given = loaded(robot, "sim")

    def with_fault(kind: Any) -> Any:
        sim = SimTable(faults=(FaultSettings(kind=kind, call=1),))
        return build_cell(replace(given, config=structs.replace(given.config, sim=sim)))

    arm, camera = with_fault("arm_lost"), with_fault("blank")
    assert (type(arm.arm), type(arm.camera)) == (arm_type, SimCamera)
    assert (isinstance(camera.arm, FaultyArm), type(camera.camera)) == (False, FaultyCamera)
    assert arm.witness is None or isinstance(arm.witness, SimArm)


def test_a_clock_handed_in_is_the_cells() -> None:
    """Events, records and the simulated world share one time."""
    given = loaded("sim", "sim")
    clock = build_clock(given)
    assert build_cell(given, clock).clock is clock


def test_the_wall_clock_does_not_wait_backwards() -> None:
    """Negative waits are none."""
    clock = WallClock()
    before = clock.monotonic()
    clock.sleep(-5.0)
    assert clock.monotonic() >= before
