"""What each topic's events hold, in words. A test holds this to the events of a real session."""

from dataclasses import dataclass
from typing import Final

COMMON: Final = ("topic", "boot", "seq", "t", "session")


@dataclass(frozen=True)
class Told:
    """When an event of a topic comes, and its fields beside the common ones."""

    when: str
    fields: dict[str, str]


FIELDS: Final[dict[str, Told]] = {
    "state": Told(
        "At every change of state.",
        {
            "state": "the new state",
            "previous": "the state before; null for the first of a boot",
            "cause": "what led here: a job's or method's name, an outcome, or a fault's cause",
            "by": "who asked, where somebody did: a client's name, or `local`",
        },
    ),
    "progress": Told(
        "When a job goes on: with each stroke, and while a picture is tried again.",
        {
            "text": "for people",
            "kind": "`press` or `draw`, for a stroke",
            "station_mm": "the station, mm from the big face, or null",
            "stroke": "number of the stroke at this station, from 1, or null",
            "done": "number of the stroke in the whole job, from 1",
            "total": "strokes in the whole job",
            "retry": "while the camera is tried again: cause, number of the try, pause in s",
        },
    ),
    "telemetry": Told(
        "While the arm moves, as often as people can see.",
        {
            "arm": "`connected`, `referenced`, `xyz_mm`, `pitch_deg`, `roll_deg`, `contact`",
            "station_mm": "the station that is being massaged, or null",
            "why": "what the motion is for: transit, approach, descend, press, draw, retract",
        },
    ),
    "contact": Told(
        "When the grip switch closes on the leg in a guarded descent.",
        {
            "station_mm": "the station",
            "stroke": "number of the stroke at this station",
            "kind": "`press` or `draw`",
            "contact_mm": "touched height over the predicted surface, along the line of descent",
            "place_mm": "where along the leg's axis it touched, by the estimated pose",
            "across_mm": "how far to the side of the leg's top line",
            "xyz_mm": "the touched place, robot base frame",
            "predicted_xyz_mm": "the predicted place",
            "steps_after": "absolute half-steps of the six motors after the touch",
        },
    ),
    "fault": Told(
        "When a fault is latched.",
        {
            "cause": "one of the [causes](faults.md)",
            "text": "what happened",
            "hint": "what to do",
            "since": "time of day, UTC",
            "session": "the session in which it happened, or null",
            "evidence": "state, arm, and what the place that found it knows besides",
        },
    ),
    "session": Told(
        "When a session begins, with outcome null, and when it ends.",
        {
            "id": "the session",
            "job": "what it does",
            "by": "who asked for it",
            "outcome": "how it ended; null at its beginning",
            "reason": "why, where there is a reason",
        },
    ),
    "campaign": Told(
        "When a campaign begins, goes on, resets a fault, or ends.",
        {
            "what": "`begun`, `repetition`, `session`, `reset`, `ending` or `ended`",
            "id": "the campaign",
            "job": "what it repeats",
            "by": "who asked for it",
            "underway": "whether it goes on, or its last repetition does",
            "session": "the session under way, or null",
            "done": "repetitions that ended as done",
            "failed": "repetitions that ended otherwise",
            "total": "how many were asked for, or null",
            "next_in_s": "the cell's s until it does something by itself, or null",
            "resets": "resets that were tried",
            "resets_left": "resets that are still allowed",
            "outcome": "how it ended; null before",
            "reason": "why it ended, or null",
            "ended": "time of day, UTC; null before",
        },
    ),
    "heartbeat": Told(
        "Every second.",
        {
            "state": "the present state",
            "uptime_s": "s since the daemon started",
        },
    ),
}
