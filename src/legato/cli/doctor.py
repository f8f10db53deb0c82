"""What `legato check` looks at, each with what to do; nothing is opened that could move."""

import grp
import os
import pwd
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from legato.config.load import Loaded
    from legato.geometry.transforms import Array

OLD_DAYS = 180


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at; `ok` is None where it deserves a look but hinders nothing."""

    name: str
    ok: bool | None
    text: str
    hint: str = ""


def examine(loaded: "Loaded", now: datetime) -> Iterator[Finding]:
    """Yield what is found of a configuration that can be loaded."""
    yield Finding("configuration", True, f"{loaded.path}")
    yield intrinsics(loaded, now)
    yield from stations(loaded)
    yield arm(loaded)
    yield camera(loaded)
    yield state_dir(loaded)
    yield free_space(loaded)
    yield from faults(loaded)


def faults(loaded: "Loaded") -> Iterator[Finding]:
    """Yield that devices will go wrong on schedule, where they will."""
    found = loaded.config.sim.faults
    if found:
        real = loaded.config.robot.driver != "sim"
        text = f"{len(found)} on schedule: {', '.join(fault.kind for fault in found)}"
        hint = "take sim.faults out of this file before the arm does any work"
        yield Finding("faults", False if real else None, text, hint)


def intrinsics(loaded: "Loaded", now: datetime) -> Finding:
    """Return whether the camera is calibrated, and how long ago."""
    from legato.config.errors import ConfigError
    from legato.config.load import load

    try:
        found = load(loaded.path).intrinsics
    except ConfigError as error:
        hint = error.hint or "make it again with `legato intrinsics`"
        return Finding("intrinsics", False, str(error), hint)
    if found is None:
        hint = "calibrate the camera with `legato intrinsics` and name the file"
        text = "estimated anew from each picture, some twenty times less exact"
        return Finding("intrinsics", None, text, hint)
    days, most = (now - found.dated()).days, loaded.config.camera.max_intrinsics_age_days
    text = f"{found.views} views, {found.rms_px:.3f} px rms, {days} days old"
    if days > most:
        hint = "calibrate the camera again, or set camera.max_intrinsics_age_days"
        return Finding("intrinsics", False, f"{text}, {most:g} are allowed", hint)
    if days > OLD_DAYS:
        return Finding("intrinsics", None, text, "calibrate the camera again: mounts creep")
    return Finding("intrinsics", True, text)


def stations(loaded: "Loaded") -> Iterator[Finding]:
    """Yield whether each station can be reached from above where the leg is thought to lie."""
    from legato.config.build import arm_model, leg
    from legato.control.plan import finger_roll
    from legato.geometry.arm import Unreachable, reach
    from legato.geometry.transforms import apply

    known = nominal_leg(loaded)
    if known is None:
        text = "not looked at: no session has found the leg yet"
        yield Finding("stations", None, text, "run `legato run` once, then check again")
        return
    import numpy as np

    pose, source = known
    model, shape, table = arm_model(loaded.config), leg(loaded.config), loaded.config.leg
    yaw = float(np.arctan2(pose[1, 0], pose[0, 0]))
    for station in table.stations_mm:
        surface = apply(pose, shape.surface_point([station]))[0]
        above = surface + table.approach_mm * (pose[:3, :3] @ shape.surface_normal())
        name = f"station {station:g} mm"
        try:
            for place in (surface, above):
                roll = finger_roll(float(np.arctan2(place[1], place[0])), yaw)
                reach(model, place, -np.pi / 2, roll)
        except Unreachable as error:
            yield Finding(name, False, str(error), "move the leg into the arm's reach")
        else:
            yield Finding(name, True, f"within reach, the leg as in {source}")


def nominal_leg(loaded: "Loaded") -> tuple["Array", str] | None:
    """Return world_from_object as configured or as last found, and where that is from."""
    import numpy as np

    from legato.records.errors import RecordError
    from legato.records.store import Store

    if loaded.config.robot.driver == "sim":
        return sim_leg(loaded), "[sim]"
    try:
        store = Store(Path(loaded.config.records.state_dir))
        for summary in store.sessions()[:50]:
            found = store.read(summary.id).calibration
            if summary.outcome == "done" and found and found.get("accepted"):
                return np.array(found["world_from_object"], dtype=float), summary.id
    except RecordError:
        return None
    return None


def sim_leg(loaded: "Loaded") -> "Array":
    """Return where the simulated leg lies before its scatter."""
    import numpy as np
    from msgspec import structs

    from legato.drivers.sim.world import drawn_pose

    still = structs.replace(loaded.config.sim, scatter_mm=0.0, scatter_deg=0.0)
    return drawn_pose(still, np.random.default_rng(0))


def arm(loaded: "Loaded") -> Finding:
    """Return whether the arm's port is there and may be used; it is not opened."""
    robot = loaded.config.robot
    if robot.driver == "sim":
        return Finding("arm", True, "simulated")
    return device("arm", Path(robot.port), "plug the adapter in, or set robot.port")


def camera(loaded: "Loaded") -> Finding:
    """Return whether the camera's source is there and may be read; it is not opened."""
    table = loaded.config.camera
    if table.driver == "sim":
        return Finding("camera", True, "simulated")
    if isinstance(table.source, str) and "://" in table.source:
        return Finding("camera", None, f"{table.source} is a stream", "capture shows if it answers")
    if isinstance(table.source, str) and "%" in table.source:
        folder = Path(table.source).parent
        return device("camera", folder, "set camera.source to a pattern of pictures")
    path = Path(f"/dev/video{table.source}" if isinstance(table.source, int) else table.source)
    return device("camera", path, "plug the camera in, or set camera.source")


def device(name: str, path: Path, hint: str) -> Finding:
    """Return whether a device or file is there with the rights it needs."""
    if not path.exists():
        return Finding(name, False, f"{path} is not there", hint)
    need = os.R_OK | (os.W_OK if path.is_char_device() else 0)
    if os.access(path, need):
        return Finding(name, True, str(path))
    group = grp.getgrgid(path.stat().st_gid).gr_name
    user = pwd.getpwuid(os.geteuid()).pw_name
    return Finding(
        name, False, f"{user} may not use {path}", f"add {user} to group {group}, then log in anew"
    )


def state_dir(loaded: "Loaded") -> Finding:
    """Return whether records can be written."""
    folder = Path(loaded.config.records.state_dir)
    place = folder
    while not place.exists() and place != place.parent:
        place = place.parent
    if place.is_dir() and os.access(place, os.W_OK | os.X_OK):
        made = "" if place == folder else " (made at the first session)"
        return Finding("state_dir", True, f"{folder}{made}")
    text = f"{place} cannot be written" if place.is_dir() else f"{place} is no folder"
    return Finding("state_dir", False, text, "give its user the right, or set records.state_dir")


def free_space(loaded: "Loaded") -> Finding:
    """Return whether there is room for records."""
    from legato.records.errors import RecordError
    from legato.records.store import Store

    least = loaded.config.records.min_free_mb
    try:
        free = Store(Path(loaded.config.records.state_dir)).free_mb()
    except RecordError as error:
        return Finding("free space", False, error.text, error.hint)
    text = f"{free:.0f} MB free, {least} MB needed"
    hint = "" if free >= least else "free space, or set records.state_dir to another disk"
    return Finding("free space", free >= least, text, hint)
