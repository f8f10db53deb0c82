"""A way gone through in the head: every motion command of it asked of the safety envelope.

Verify rehearses a whole massage; a job rehearses its way before its first motion. Half-steps and
the height of the true contact make the way that is gone a little other than the one rehearsed:
verify keeps a margin, so that what it accepts is not refused in the middle.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from legato.control.effects import Move, Why
from legato.control.envelope import ROUNDING, broken
from legato.control.perceive import Calibration
from legato.control.plan import StationPlan, plan_stations, transit
from legato.control.settings import CellSettings
from legato.geometry.arm import Unreachable
from legato.geometry.motion import ToolPose, move_between, pose_steps, rounded, straight_path
from legato.geometry.transforms import Array

MARGIN_MM = 0.5
MARGIN_RAD = np.radians(0.3)


@dataclass(frozen=True)
class Way:
    """Poses to be passed through in straight lines, and where the fingertip may touch on it."""

    poses: tuple[ToolPose, ...]
    why: Why
    station: float | None = None
    until: float | None = None


def dry_run(calibration: Calibration, settings: CellSettings) -> list[str]:
    """Return what would go wrong in a massage from home to home, one sentence for each station."""
    problems = []
    here = settings.home
    plans = plan_stations(settings, calibration)
    for plan, onward in zip(plans, [*plans[1:], None], strict=True):
        ways = _ways(settings, here, plan, onward, first=here is settings.home)
        found = next(filter(None, (_tight(settings, calibration, way) for way in ways)), None)
        if found:
            problems.append(f"station {plan.station:g} mm: {found}")
        here = plan.approach
    home = Way((here, *transit(settings, here, settings.home)), Why.TRANSIT)
    found = _tight(settings, calibration, home)
    last = f"station {plans[-1].station:g} mm"
    return problems + ([f"the way home from {last}: {found}"] if found else [])


def _ways(
    settings: CellSettings,
    here: ToolPose,
    plan: StationPlan,
    onward: StationPlan | None,
    first: bool,
) -> list[Way]:
    """Return a pass at one station: to the lead-in, to the approach, down, and on if it draws."""
    lead_in = transit(settings, here, plan.lead_in) if first else [plan.lead_in]
    massage = settings.massage
    deepest = plan.at(-massage.contact_window_mm - massage.depths[-1])
    ways = [
        Way((here, *lead_in), Why.TRANSIT),
        Way((plan.lead_in, plan.approach), Why.APPROACH),
        Way((plan.approach, deepest), Why.DESCEND, plan.station),
    ]
    if onward is not None and massage.draw.count:
        depth = -massage.contact_window_mm - massage.draw.depth_mm
        along = (plan.at(depth), onward.at(depth), onward.approach)
        ways.append(Way(along, Why.DRAW, plan.station, onward.station))
    return ways


def _tight(settings: CellSettings, calibration: Calibration, way: Way) -> str | None:
    """Return the first thing that forbids a way, or comes within the margin."""
    return problem(settings, calibration.world_from_object, way, MARGIN_MM, -MARGIN_RAD)


def problem(
    settings: CellSettings,
    world_from_object: Array | None,
    way: Way,
    margin: float = 0.0,
    tolerance: float = ROUNDING,
) -> str | None:
    """Return the first thing that forbids a way, None where it is safe.

    `world_from_object` is None while the leg has not been found. `margin` (mm) is how much farther
    off it has to keep, `tolerance` (rad) how far it may pass a joint's limit.
    """
    for start, end in pairwise(way.poses):
        try:
            path = straight_path(
                settings.arm, start, end, scale=settings.speed_scale, tolerance=tolerance
            )
        except Unreachable as error:
            return str(error)
        way_steps = np.vstack([pose_steps(settings.arm, start.vector()), path])
        whole = rounded(way_steps, settings.arm.grip_per_elbow)
        for a, b in pairwise(whole):
            step = move_between(settings.arm, a, b, settings.speed_scale)
            move = Move(step, a, b, way.why, way.station, way.until)
            problems = broken(settings, world_from_object, move, margin)
            if problems:
                return problems[0]
    return None
