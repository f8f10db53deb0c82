"""The massage itself: passes of strokes, each broken off and taken up again as a whole."""

from collections.abc import Callable
from functools import partial

import numpy as np

from legato.control.effects import Enter, Hold, PauseRequested, Why
from legato.control.motion import Procedure, Track
from legato.control.plan import StationPlan, plan_stations
from legato.control.states import PAUSED, massage_state
from legato.control.strokes import Job, draw, press


def in_state(track: Track, state: str, work: Callable[[], Procedure]) -> Procedure:
    """Do a piece of work in a state; when paused, retract, hold, and do it from its start."""
    while True:
        try:
            yield Enter(state)
            return (yield from work())
        except PauseRequested:
            yield from track.retreat()
            yield Enter(PAUSED)
            yield Hold()
            track.fresh = False


def passes(job: Job) -> Procedure:
    """Make every pass in the configured order: presses at a station, then draws to the next."""
    plans = plan_stations(job.settings, job.calibration)
    massage = job.settings.massage
    done = 0
    for plan, onward in zip(plans, [*plans[1:], None], strict=True):
        state = massage_state(plan.station)
        # The first lead-in is reached by the transit, later ones along the leg.
        yield from in_state(job.track, state, partial(_approach, job, plan, done == 0))
        for stroke in range(1, massage.strokes + 1):
            done += 1
            yield from in_state(job.track, state, partial(press, job, plan, stroke, done))
        if onward is None:
            return
        for stroke in range(massage.strokes + 1, massage.strokes + massage.draw.count + 1):
            done += 1
            yield from in_state(job.track, state, partial(_approach, job, plan, False))
            yield from in_state(job.track, state, partial(draw, job, plan, onward, stroke, done))


def _approach(job: Job, plan: StationPlan, first: bool) -> Procedure:
    """Bring the fingertip above a station, its last move forward for every motor."""
    near = job.track.pose.xyz - plan.approach.xyz
    if first or np.linalg.norm(near) > job.settings.leg.length:
        yield from job.track.travel(plan.lead_in)
    else:
        yield from job.track.to(plan.lead_in, Why.TRANSIT)
    yield from job.track.to(plan.approach, Why.APPROACH)
