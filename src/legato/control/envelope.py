"""The safety envelope: what every motion command must keep to, checked in this one place.

Joint limits and motor rates, the length of a command, the workspace box, the table, and the leg:
hand, wrist and forearm stay clear of it, the fingertip too except at its station.
"""

import numpy as np

from legato.control.effects import CellFault, Move
from legato.control.settings import CellSettings
from legato.geometry.arm import ArmModel, broken_limits, joints_from_steps, skeleton
from legato.geometry.shapes import OBSTACLES, PARTS
from legato.geometry.transforms import Array, apply, invert
from legato.hal.faults import Cause

LONGEST_S = 0.2
TIP_CLEARANCE = 3.0
STATION_ALONG = 3.0
ROUNDING = np.radians(0.2)  # how far whole half-steps may take a joint past its limit
_SLACK = 1.001


def check(settings: CellSettings, world_from_object: Array | None, move: Move) -> None:
    """Raise CellFault(limit) where a motion command would leave the envelope.

    `world_from_object` is None while the leg has not been found: then nothing is known of it.
    """
    problems = broken(settings, world_from_object, move)
    if problems:
        raise CellFault(
            Cause.LIMIT,
            f"a {move.why} motion was not sent: {problems[0]}",
            "see that leg and camera stand as configured, then calibrate again",
            {"problems": problems, "target": list(move.target)},
        )


def broken(
    settings: CellSettings, world_from_object: Array | None, move: Move, margin: float = 0.0
) -> list[str]:
    """Return what a motion command would break, a sentence each, empty where it is safe.

    With a `margin` in mm it keeps so much farther off than it must.
    """
    problems = _command(settings.arm, move)
    ends = np.array([move.start, move.target], dtype=float)
    joints, _ = joints_from_steps(settings.arm, np.vstack([ends[1], ends.mean(axis=0), ends[0]]))
    problems += broken_limits(settings.arm, joints[0], tolerance=ROUNDING)
    bones = skeleton(settings.arm, joints[:2])
    problems += _box(settings, bones[0, 3], margin)
    problems += _table(settings, bones[:, 3], margin)
    problems += _shapes(settings, world_from_object, bones, margin)
    if world_from_object is not None:
        tips = skeleton(settings.arm, joints)[:, 3]
        problems += _tip(settings, world_from_object, tips, move, margin)
    return problems


def _command(model: ArmModel, move: Move) -> list[str]:
    problems = []
    if move.move.duration > LONGEST_S * _SLACK:
        problems.append(f"it would last {move.move.duration:.2f} s, more than {LONGEST_S} s")
    over = move.move.rates() > np.asarray(model.rates) * _SLACK
    if over.any():
        problems.append(f"motor {int(np.argmax(over)) + 1} would turn faster than it can")
    if any(b - a != s for a, b, s in zip(move.start, move.target, move.move.steps, strict=True)):
        problems.append("its steps do not lead from start to target")
    return problems


def _box(settings: CellSettings, tip: Array, margin: float) -> list[str]:
    space = settings.workspace
    spare = f" mm, {margin:g} mm within its sides" if margin else " mm"
    return [
        f"fingertip {axis} {value:.1f} mm is outside the workspace {low + margin:g} to "
        f"{high - margin:g}{spare}"
        for axis, value, low, high in zip("xyz", tip, space.low, space.high, strict=True)
        if not low + margin <= value <= high - margin
    ]


def _table(settings: CellSettings, tips: Array, margin: float) -> list[str]:
    below = settings.workspace.table_z - float(np.min(tips[:, 2]))
    return [f"fingertip would be {below:.1f} mm below the table"] if below > -margin else []


def _shapes(
    settings: CellSettings, world_from_object: Array | None, bones: Array, margin: float
) -> list[str]:
    """Return which parts of the arm would meet the leg, the table or the arm's own base."""
    known = world_from_object is not None
    object_from_world = np.eye(4) if world_from_object is None else invert(world_from_object)
    gaps = settings.shapes.clearance(bones, object_from_world)
    return [
        f"the {part} would meet the {obstacle} ({gap:.1f} mm)"
        for part, row in zip(PARTS, gaps.min(axis=0), strict=True)
        for obstacle, gap in zip(OBSTACLES, row, strict=True)
        if gap < margin and (known or obstacle != "leg")
    ]


def _tip(
    settings: CellSettings, world_from_object: Array, tips: Array, move: Move, margin: float
) -> list[str]:
    """Return whether the fingertip would touch the leg but at its station, or too deep there.

    `tips` are its places at the target, halfway, and at the start.
    """
    tips = apply(invert(world_from_object), tips)
    gaps = settings.leg.clearance(tips)
    depth = -float(np.min(gaps[:2]))
    if move.station is None:
        if gaps[2] < gaps[1] < gaps[0]:
            return []  # a pass that was broken off at the leg must be able to leave it
        near = f"fingertip would come within {-depth:.1f} mm of the leg"
        return [near] if depth > -TIP_CLEARANCE - margin else []
    problems = []
    massage = settings.massage
    deepest = max(massage.depths[-1], massage.draw.depth_mm)
    allowed = deepest + massage.contact_window_mm + 1.0
    if depth > allowed:
        problems.append(f"fingertip would be {depth:.1f} mm in the leg, {allowed:.1f} mm allowed")
    place = float(tips[0, 0])
    ends = move.station, move.station if move.until is None else move.until
    if depth > -TIP_CLEARANCE and not (
        min(ends) - STATION_ALONG <= place <= max(ends) + STATION_ALONG
    ):
        where = " to ".join(f"{e:g}" for e in dict.fromkeys(ends))
        problems.append(f"fingertip would touch at {place:.1f} mm, not {where} mm")
    return problems
