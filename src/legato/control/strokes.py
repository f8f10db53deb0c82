"""One stroke: approach, guarded descent until the switch closes, press or draw, dwell, retract.

Paper section 5 presses; drawing along the leg from one station to the next is an addition.
"""

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from legato.control.effects import CellFault, Dwell, Record, Why
from legato.control.motion import Procedure, Track
from legato.control.perceive import Calibration
from legato.control.plan import StationPlan
from legato.control.settings import CellSettings
from legato.geometry.motion import ToolPose
from legato.geometry.transforms import apply, invert
from legato.hal.faults import Cause


@dataclass(frozen=True)
class Job:
    """What every stroke needs to hand; `first` keeps each station's first contact height."""

    settings: CellSettings
    calibration: Calibration
    track: Track
    first: dict[float, float] = field(default_factory=dict)

    @property
    def total(self) -> int:
        """Strokes in all."""
        stations, massage = len(self.settings.stations), self.settings.massage
        return stations * massage.strokes + (stations - 1) * massage.draw.count


def press(job: Job, plan: StationPlan, stroke: int, done: int) -> Procedure:
    """Press at one station."""
    massage = job.settings.massage
    height = yield from _touch(job, plan, stroke, done, "press")
    for depth in massage.depths:
        yield from job.track.to(plan.at(height - depth), Why.PRESS, massage.press_speed_mm_s)
    yield Dwell(massage.dwell_s)
    yield from job.track.retreat()


def draw(job: Job, plan: StationPlan, onward: StationPlan, stroke: int, done: int) -> Procedure:
    """Press at one station and draw along the leg's surface to the next."""
    settings = job.settings.massage.draw
    height = yield from _touch(job, plan, stroke, done, "draw")
    deep = plan.at(height - settings.depth_mm)
    yield from job.track.to(deep, Why.PRESS, job.settings.massage.press_speed_mm_s)
    job.track.touching = (plan.station, onward.station)
    job.track.lift = partial(_lifted, plan, onward, job.settings.approach)
    # The surface is straight between two stations, and as far from its prediction as it was here.
    end = onward.at(height - settings.depth_mm)
    yield from job.track.to(end, Why.DRAW, settings.speed_mm_s)
    yield Dwell(settings.dwell_s)
    yield from job.track.retreat()


def _lifted(plan: StationPlan, onward: StationPlan, approach: float, pose: ToolPose) -> ToolPose:
    """Return a pose between two stations brought up to the approach height."""
    way = onward.surface - plan.surface
    part = float(np.clip((pose.xyz - plan.surface) @ way / (way @ way), 0.0, 1.0))
    x, y, z = plan.surface + part * way + approach * plan.up
    return replace(pose, x=float(x), y=float(y), z=float(z))


def _touch(job: Job, plan: StationPlan, stroke: int, done: int, kind: str) -> Procedure:
    """Go down onto the leg, record the contact, and return its height over the prediction."""
    track = job.track
    if np.linalg.norm(track.pose.xyz - plan.approach.xyz) > 0.5:
        yield from track.to(plan.approach, Why.APPROACH)
    what = {"station_mm": plan.station, "stroke": stroke, "kind": kind}
    text = f"{kind} {stroke} at {plan.station:g} mm"
    yield Record("progress", {"text": text, **what, "done": done, "total": job.total})
    yield from track.look()
    if track.contact:
        yield from _away(job, plan)
        raise _early(plan, job.settings.approach, "before the descent")
    track.lift, track.touching = (lambda _: plan.approach), (plan.station, None)
    height = yield from _descend(job, plan)
    yield Record("contact", what | _contact(job, plan, height))
    drift = height - job.first.setdefault(plan.station, height)
    if abs(drift) > job.settings.massage.drift_mm:
        yield from track.retreat()
        raise _moved(plan, drift)
    return height


def _descend(job: Job, plan: StationPlan) -> Procedure:
    """Go down in guarded steps until the switch closes; return the height of the contact.

    The contact lies between the last step with the switch open and the first with it closed.
    """
    track, massage = job.track, job.settings.massage
    above = height = plan.height(track.pose.xyz)
    while not track.contact:
        above = min(above, height)
        below = above - massage.descent_mm
        if below < -massage.contact_window_mm:
            yield from track.retreat()
            raise _late(plan, above)
        yield from track.to(plan.at(below), Why.DESCEND)
        height = plan.height(track.pose.xyz)
    touched = (above + height) / 2.0
    if touched > massage.contact_window_mm:
        yield from _away(job, plan)
        raise _early(plan, touched, "in the descent")
    return touched


def _away(job: Job, plan: StationPlan) -> Procedure:
    """Come off what was met too early: up to the approach, and as much again where need be."""
    yield from job.track.retreat()
    if job.track.contact:
        yield from job.track.to(plan.at(2.0 * job.settings.approach), Why.RETRACT)


def _contact(job: Job, plan: StationPlan, height: float) -> dict[str, Any]:
    """Return the contact event: height over the prediction, place along and across the leg."""
    touch = plan.surface + height * plan.up
    tip = job.track.pose.xyz + (height - plan.height(job.track.pose.xyz)) * plan.up
    along, across, _ = apply(invert(job.calibration.world_from_object), tip[None])[0]
    return {
        "contact_mm": round(height, 3),
        "place_mm": round(float(along), 3),
        "across_mm": round(float(across), 3),
        "xyz_mm": [round(float(v), 3) for v in touch],
        "predicted_xyz_mm": [round(float(v), 3) for v in plan.surface],
        "steps_after": list(job.track.steps),
    }


def _early(plan: StationPlan, height: float, when: str) -> CellFault:
    return CellFault(
        Cause.CONTACT_EARLY,
        f"the switch closed {when}, {height:.1f} mm above the surface at {plan.station:g} mm",
        "see that nothing lies on the leg, that the leg has not moved, and that the switch is free",
        {"station_mm": plan.station, "height_mm": height},
    )


def _late(plan: StationPlan, height: float) -> CellFault:
    return CellFault(
        Cause.CONTACT_LATE,
        f"no contact down to {-height:.1f} mm below the surface at {plan.station:g} mm",
        "see that the leg has not moved and that the grip switch closes, then calibrate again",
        {"station_mm": plan.station, "height_mm": height},
    )


def _moved(plan: StationPlan, drift: float) -> CellFault:
    return CellFault(
        Cause.LEG_MOVED,
        f"the surface at {plan.station:g} mm is {drift:+.1f} mm from where it was first touched",
        "see that the leg lies firmly and that the arm has not lost steps, then calibrate again",
        {"station_mm": plan.station, "drift_mm": drift},
    )
