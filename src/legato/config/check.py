"""What must hold between the configuration's keys before anything opens; first breach raises.

Types and single ranges are the schema's business; here stand the checks across keys.
"""

import re
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from legato.config.build import arm_model, leg
from legato.config.endpoints import check_endpoint, check_listen
from legato.config.errors import ABSENT, ConfigError
from legato.config.schema import Config, Point, PoseTable, ServerTable
from legato.control.states import MASSAGE_DEADLINE, massage_state
from legato.drivers.faulty.settings import CALLS
from legato.geometry.arm import Unreachable, reach
from legato.geometry.transforms import (
    NotARotation,
    checked_transform,
    look_at,
    nearest_rotation,
)

MARK_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,15}")
FEWEST_MARKS = 7
FEWEST_USED = 6  # with a known camera; the calibration asks for more where it is free
SURFACE_MM = 0.5
DEEPEST = 5.0  # mm beyond contact
STROKE_S = 30.0  # about what a stroke takes beside its dwell


def check(config: Config, file: Path) -> None:
    """Raise ConfigError for the first thing that does not fit together in `config`."""
    check_server(config.server, file, encrypted=config.server.curve is not None)
    _check_camera_pose(config, file)
    _check_ranges(config, file)
    _check_leg(config, file)
    _check_marks(config, file)
    _check_calibration(config, file)
    _check_arm(config, file)
    _check_sim(config, file)
    _check_faults(config, file)
    _check_massage(config, file)
    _check_records(config, file)
    check_listen(file, "metrics.listen", config.metrics.listen)


def check_server(server: ServerTable, file: Path, *, encrypted: bool) -> None:
    """Raise ConfigError for an endpoint beyond loopback that is not encrypted, or named twice."""
    for name, other in (("client_secret", "server_public"), ("server_public", "client_secret")):
        if getattr(server, name) is None and getattr(server, other) is not None:
            expected = f"a key file, since server.{other} is given"
            hint = "make keys with `legato keygen`"
            raise ConfigError(file, f"server.{name}", ABSENT, expected, hint)
    endpoints = {"requests": server.requests, "events": server.events, "stop": server.stop}
    seen: dict[str, str] = {}
    for name, endpoint in endpoints.items():
        check_endpoint(file, f"server.{name}", endpoint, encrypted=encrypted)
        if endpoint in seen and not endpoint.endswith(":*"):
            expected = f"another endpoint than server.{seen[endpoint]}'s"
            raise ConfigError(file, f"server.{name}", endpoint, expected)
        seen[endpoint] = name


def _check_camera_pose(config: Config, file: Path) -> None:
    """Raise ConfigError unless the camera's pose is given once and is a rigid transform."""
    cell = config.cell
    looks = {"camera_at_mm": cell.camera_at_mm, "camera_looks_at_mm": cell.camera_looks_at_mm}
    if cell.world_from_camera is not None:
        for name, value in looks.items():
            if value is not None:
                expected = "nothing, since cell.world_from_camera is given: one of the two"
                raise ConfigError(file, f"cell.{name}", list(value), expected)
        _check_transform("cell.world_from_camera", cell.world_from_camera, file)
        return
    if cell.camera_at_mm is None or cell.camera_looks_at_mm is None:
        name = next(name for name, value in looks.items() if value is None)
        expected = "camera_at_mm with camera_looks_at_mm, or world_from_camera"
        raise ConfigError(file, f"cell.{name}", ABSENT, expected)
    key = "cell.camera_looks_at_mm"
    _check_aim(key, cell.camera_at_mm, cell.camera_looks_at_mm, file)


def _check_transform(key: str, matrix: Any, file: Path) -> None:
    """Raise ConfigError unless `matrix` is a rigid transform; the hint prints the nearest one."""
    try:
        checked_transform(matrix)
    except NotARotation as error:
        expected = (
            "a rotation, determinant 1 and R^T R = I within 1e-6, "
            f"not determinant {error.determinant:.4f} and error {error.error:.2e}"
        )
        nearest = np.array(matrix, dtype=float)
        nearest[:3, :3] = nearest_rotation(nearest[:3, :3])
        rows = ", ".join(f"[{', '.join(f'{v:.9f}' for v in row)}]" for row in nearest)
        hint = f"measure again, or if it is rounding only, the nearest is [{rows}]"
        raise ConfigError(file, key, _rows(matrix), expected, hint) from error
    except ValueError as error:
        raise ConfigError(file, key, _rows(matrix), str(error)) from error


def _rows(matrix: Any) -> list[list[float]]:
    """Return a matrix as lists, as it stands in the file."""
    return [list(row) for row in matrix]


def _ranges(config: Config) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield every key that holds a low and a high value."""
    for name in config.calibration.bounds.__struct_fields__:
        yield f"calibration.bounds.{name}", getattr(config.calibration.bounds, name)
    yield "calibration.leg_rests_mm", config.calibration.leg_rests_mm
    for name in ("base_deg", "shoulder_deg", "elbow_deg", "wrist_deg", "roll_deg"):
        yield f"robot.{name}", getattr(config.robot, name)
    for name in ("x_mm", "y_mm", "z_mm"):
        yield f"cell.workspace.{name}", getattr(config.cell.workspace, name)


def _check_ranges(config: Config, file: Path) -> None:
    """Raise ConfigError where a range's low end is not below its high end, or has no meaning."""
    for key, (low, high) in _ranges(config):
        if not low < high:
            raise ConfigError(file, key, [low, high], "a low value and then a higher one")
    bounds = config.calibration.bounds
    for name in ("f", "s_x", "s_y"):
        low, high = getattr(bounds, name)
        if low <= 0:
            key = f"calibration.bounds.{name}"
            raise ConfigError(file, key, [low, high], "a range above 0")
    if bounds.t_z[0] < 0:
        expected = "a range from 0 up: the leg is in front of the camera"
        raise ConfigError(file, "calibration.bounds.t_z", list(bounds.t_z), expected)


def _check_leg(config: Config, file: Path) -> None:
    """Raise ConfigError unless the leg tapers and its stations lie on it, in order."""
    table = config.leg
    if not table.small_radius_mm < table.big_radius_mm:
        expected = f"less than leg.big_radius_mm, {table.big_radius_mm:g}"
        raise ConfigError(file, "leg.small_radius_mm", table.small_radius_mm, expected)
    stations = list(table.stations_mm)
    for index, station in enumerate(stations):
        if not 0 <= station <= table.length_mm:
            expected = f"a place on the leg, 0 to leg.length_mm = {table.length_mm:g} mm"
            raise ConfigError(file, f"leg.stations_mm[{index}]", station, expected)
    if any(a >= b for a, b in pairwise(stations)):
        raise ConfigError(file, "leg.stations_mm", stations, "distinct places in rising order")
    names = Counter(massage_state(s) for s in stations)
    for name, count in names.items():
        if count > 1:
            expected = f"places far enough apart to have a state each, not {count} {name}"
            raise ConfigError(file, "leg.stations_mm", stations, expected)
    if not config.massage.contact_window_mm < table.approach_mm:
        expected = f"less than leg.approach_mm, {table.approach_mm:g}"
        value = config.massage.contact_window_mm
        raise ConfigError(file, "massage.contact_window_mm", value, expected)


def _check_marks(config: Config, file: Path) -> None:
    """Raise ConfigError unless enough marks with fit names lie on the leg's surface."""
    marks = config.leg.marks
    if len(marks) < FEWEST_MARKS:
        expected = f"at least {FEWEST_MARKS} marks"
        raise ConfigError(file, "leg.marks", f"{len(marks)} marks", expected)
    for name in marks:
        if not MARK_NAME.fullmatch(name):
            expected = "a mark's name: a letter, then letters, digits or _, 16 at most"
            raise ConfigError(file, f"leg.marks.{name}", name, expected)
    shape = leg(config)
    for name, clearance in zip(marks, shape.clearance(shape.points()), strict=True):
        if abs(clearance) > SURFACE_MM:
            expected = f"a place on the leg's surface to {SURFACE_MM} mm, not {clearance:+.2f} mm"
            hint = "measured outward from radii and length in [leg]"
            raise ConfigError(file, f"leg.marks.{name}", list(marks[name]), expected, hint)


def _check_calibration(config: Config, file: Path) -> None:
    """Raise ConfigError for marks that are not there and for intrinsics that nobody gives."""
    used = config.calibration.marks
    for index, name in enumerate(used):
        if name not in config.leg.marks:
            expected = f"one of leg.marks: {', '.join(config.leg.marks)}"
            raise ConfigError(file, f"calibration.marks[{index}]", name, expected)
    if len(set(used)) < len(used):
        raise ConfigError(file, "calibration.marks", list(used), "each mark once")
    if used and len(used) < FEWEST_USED:
        expected = f"at least {FEWEST_USED} marks, or none for all"
        raise ConfigError(file, "calibration.marks", list(used), expected)
    if config.calibration.intrinsics == "known" and config.camera.intrinsics is None:
        hint = 'make one with `legato intrinsics`, or set calibration.intrinsics = "free"'
        expected = 'an intrinsics file, since calibration.intrinsics = "known"'
        raise ConfigError(file, "camera.intrinsics", ABSENT, expected, hint)


def _check_arm(config: Config, file: Path) -> None:
    """Raise ConfigError unless the arm can stand at its start pose and at home."""
    robot = config.robot
    if not robot.finger_length_mm < robot.hand_mm:
        expected = f"less than robot.hand_mm, {robot.hand_mm:g}"
        raise ConfigError(file, "robot.finger_length_mm", robot.finger_length_mm, expected)
    box = config.cell.workspace
    for axis, place, limits in zip(
        "xyz", robot.home.xyz_mm, (box.x_mm, box.y_mm, box.z_mm), strict=True
    ):
        if not limits[0] <= place <= limits[1]:
            expected = f"{axis} inside cell.workspace, {limits[0]:g} to {limits[1]:g} mm"
            raise ConfigError(file, "robot.home.xyz_mm", list(robot.home.xyz_mm), expected)
    if robot.home.xyz_mm[2] <= config.cell.table_z_mm:
        expected = f"a place above the table, cell.table_z_mm = {config.cell.table_z_mm:g}"
        raise ConfigError(file, "robot.home.xyz_mm", list(robot.home.xyz_mm), expected)
    _check_reach(config, "robot.home", robot.home, file)
    _check_reach(config, "robot.start", robot.start, file)


def _check_sim(config: Config, file: Path) -> None:
    """Raise ConfigError for a simulated arm or camera that cannot stand where it truly is."""
    sim = config.sim
    truth = PoseTable(xyz_mm=sim.arm_at_mm, pitch_deg=sim.arm_pitch_deg, roll_deg=sim.arm_roll_deg)
    if config.robot.driver == "sim":
        _check_reach(config, "sim.arm_at_mm", truth, file)
    if config.camera.driver == "sim":
        _check_aim("sim.camera_looks_at_mm", sim.camera_at_mm, sim.camera_looks_at_mm, file)


def _check_faults(config: Config, file: Path) -> None:
    """Raise ConfigError for a fault without one beginning, or on a call of the other device."""
    for index, fault in enumerate(config.sim.faults):
        key = f"sim.faults[{index}]"
        begins = {n: getattr(fault, n) for n in ("at_s", "call", "p")}
        given = [name for name, value in begins.items() if value is not None]
        if len(given) != 1:
            expected = "one of at_s, call and p: when it begins"
            value = begins[given[-1]] if given else ABSENT
            raise ConfigError(file, f"{key}.{given[-1]}" if given else key, value, expected)
        calls = CALLS[fault.device]
        if fault.counted not in calls:
            expected = f"a call of the {fault.device}: {', '.join(calls)}"
            raise ConfigError(file, f"{key}.on", fault.counted, expected)


def _check_massage(config: Config, file: Path) -> None:
    """Raise ConfigError where a press is too deep, or a station's strokes outlast its deadline."""
    massage, draws = config.massage, config.massage.draw
    if massage.depths[-1] > DEEPEST:
        expected = (
            f"{DEEPEST / massage.descent_mm:.0f} steps at most: {DEEPEST:g} mm beyond contact"
        )
        raise ConfigError(file, "massage.press_steps", massage.press_steps, expected)
    each = massage.dwell_s + STROKE_S
    whole = massage.strokes * each + draws.count * (draws.dwell_s + STROKE_S)
    if whole < MASSAGE_DEADLINE:
        return
    most = f"under the {MASSAGE_DEADLINE:g} s that a station may take, not {whole:g} s"
    about = f"with about {STROKE_S:g} s a stroke beside its dwell"
    if massage.strokes * each < MASSAGE_DEADLINE:
        expected = f"draws with massage.draw.dwell_s = {draws.dwell_s:g} and massage.strokes {most}"
        raise ConfigError(file, "massage.draw.count", draws.count, expected, about)
    expected = f"strokes with massage.dwell_s = {massage.dwell_s:g} {most}"
    raise ConfigError(file, "massage.strokes", massage.strokes, expected, about)


def _check_records(config: Config, file: Path) -> None:
    """Raise ConfigError where a file stands at the place of the records' folder."""
    place = Path(config.records.state_dir)
    taken = False
    with suppress(OSError):  # who may not look is told when the records are opened
        taken = place.exists() and not place.is_dir()
    if taken:
        raise ConfigError(file, "records.state_dir", str(place), "a folder, or a place for one")


def _check_aim(key: str, eye: Point, target: Point, file: Path) -> None:
    """Raise ConfigError where a camera at `eye` cannot be aimed at `target` with its x level."""
    try:
        look_at(eye, target)
    except ValueError as error:
        expected = f"a place that the camera can look at: {error}"
        raise ConfigError(file, key, list(target), expected) from error


def _check_reach(config: Config, key: str, pose: PoseTable, file: Path) -> None:
    """Raise ConfigError where the arm cannot take a pose within its limits."""
    pitch, roll = np.radians([pose.pitch_deg, pose.roll_deg])
    try:
        reach(arm_model(config), pose.xyz_mm, float(pitch), float(roll))
    except Unreachable as error:
        expected = f"a pose within the arm's reach and limits: {error}"
        raise ConfigError(file, key, list(pose.xyz_mm), expected) from error
