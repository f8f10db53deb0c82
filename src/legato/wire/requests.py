"""What may be asked: one type a method, whose fields are the method's parameters.

Names and meanings are part of the wire. Unknown parameters and wrong types are refused.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

import msgspec
from msgspec import Meta, Struct

API: Final = "1"
OUTCOMES: Final = ("done", "stopped", "refused", "fault", "interrupted")
TOPICS: Final = (
    "state", "progress", "telemetry", "contact", "fault", "session", "campaign", "heartbeat",
)  # fmt: skip

Name = Annotated[str, Meta(min_length=1, max_length=128)]
Point = tuple[float, float, float]
Picks = Annotated[dict[Name, tuple[float, float]], Meta(min_length=1, max_length=100)]


class Ping(Struct, frozen=True, forbid_unknown_fields=True):
    """Say that the daemon lives: its boot, state, and clock."""


class Status(Struct, frozen=True, forbid_unknown_fields=True):
    """Return the state of the cell, its arm, camera, calibration and fault."""


class Describe(Struct, frozen=True, forbid_unknown_fields=True):
    """Return methods, states, the table of both, errors, fault causes and outcomes."""


class Acting(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What changes the cell.

    `lease` is the lease's token where one is held. Past `expires_at`, in the daemon's monotonic s
    as `ping` tells it in `now`, nothing is done any more.
    """

    lease: Name | None = None
    expires_at: float | None = None


class Job(Acting, frozen=True, kw_only=True):
    """Start a job and return its session at once.

    The same `key` again returns the same session and starts nothing.
    """

    key: Name | None = None


class Picking(Job, frozen=True, kw_only=True):
    """A job that finds the leg; `picks` are marks that a person has named, by place (u, v) in px.

    They hold for the second picture of verify too, until the leg is found anew.
    """

    picks: Picks | None = None


class Run(Picking, frozen=True, kw_only=True):
    """Find the leg, verify, go home, massage every station, go home."""


class Capture(Job, frozen=True):
    """Take a picture."""


class Calibrate(Picking, frozen=True, kw_only=True):
    """Find the leg in the last picture, or in a new one."""


class Verify(Job, frozen=True):
    """Decide whether the calibration may be used."""


class Home(Job, frozen=True):
    """Go to the parked pose."""


class Massage(Job, frozen=True):
    """Massage every station with the verified calibration."""


class Campaign(Acting, frozen=True, kw_only=True):
    """Repeat a job, so many times or until a time, at once or every so often.

    It ends with the first of `count`, `for_s` and `until` (an ISO time with its zone), of which one
    is given. `every_s`, from start to start, and `for_s` are the cell's s. A fault of the camera is
    reset by itself at most `resets` times; any other fault, and any stop, ends it. The same `key`
    again starts nothing.
    """

    job: Literal["run", "capture", "calibrate", "verify", "home", "massage"] = "run"
    count: Annotated[int, Meta(ge=1, le=10_000)] | None = None
    every_s: Annotated[float, Meta(ge=0, le=604_800)] = 0.0
    for_s: Annotated[float, Meta(gt=0, le=31_622_400)] | None = None
    until: Name | None = None
    resets: Annotated[int, Meta(ge=0, le=100)] = 0
    key: Name | None = None


class EndCampaign(Acting, frozen=True):
    """Let the repetition under way end, and begin no other."""


class Campaigns(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Return a campaign's summary, or list the latest campaigns, newest first."""

    campaign: Name | None = None
    limit: Annotated[int, Meta(ge=1, le=200)] = 20


class Pause(Acting, frozen=True):
    """Retract at the next safe point and hold."""


class Resume(Acting, frozen=True):
    """Go on with the stroke that was broken off."""


class Stop(Struct, frozen=True, forbid_unknown_fields=True):
    """Finish the current short motion, retract, end the job as stopped."""


class Estop(Struct, frozen=True, forbid_unknown_fields=True):
    """Send no further motion command; fault. Never refused."""


class StopNow(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Stop, on the stop line; answered when the motion on its way has ended or the time is up."""

    timeout_s: Annotated[float, Meta(ge=0, le=30)] = 0.3


class EstopNow(StopNow, frozen=True, kw_only=True):
    """Send no further motion command, on the stop line; answered like stop."""


class Reset(Acting, frozen=True):
    """Leave fault once arm and camera answer."""


class Reference(Acting, frozen=True, kw_only=True):
    """Say at which pose the arm stands now; the configured start pose by default."""

    xyz_mm: Point | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None


class Wait(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Answer when a session has ended or the time is up (outcome null)."""

    session: Name
    timeout_s: Annotated[float, Meta(ge=0, le=86400)] = 60.0


class Sessions(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """List the latest sessions, newest first."""

    limit: Annotated[int, Meta(ge=1, le=200)] = 20


class Session(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Return one session: job, times, outcome, reason."""

    session: Name


class EventsSince(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Replay the events after `seq` of a boot, oldest first, as far as they are still kept."""

    boot: Name
    seq: Annotated[int, Meta(ge=0)]
    limit: Annotated[int, Meta(ge=1, le=1000)] = 500


class Lease(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Keep the cell for this client: others may read and stop, nothing else.

    Renewed by the token in `lease`, ended by `duration_s` 0. With `deadman` a lease that ends for
    want of renewal pauses the arm.
    """

    lease: Name | None = None
    duration_s: Annotated[float, Meta(ge=0, le=60)] = 10.0
    deadman: bool = False


class Shutdown(Acting, frozen=True):
    """Stop what runs, let go of the devices, end the daemon."""


Request = (
    Ping | Status | Describe | Wait | Sessions | Session | EventsSince | Shutdown | Job
    | Pause | Resume | Stop | Estop | Reset | Reference | Lease | Campaign | EndCampaign | Campaigns
)  # fmt: skip

REQUESTS: Final[dict[str, type[Struct]]] = {
    "ping": Ping,
    "status": Status,
    "describe": Describe,
    "run": Run,
    "capture": Capture,
    "calibrate": Calibrate,
    "verify": Verify,
    "home": Home,
    "massage": Massage,
    "campaign": Campaign,
    "end_campaign": EndCampaign,
    "campaigns": Campaigns,
    "pause": Pause,
    "resume": Resume,
    "stop": Stop,
    "estop": Estop,
    "reset": Reset,
    "reference": Reference,
    "wait": Wait,
    "sessions": Sessions,
    "session": Session,
    "events_since": EventsSince,
    "lease": Lease,
    "shutdown": Shutdown,
}

STOP_LINE: Final[dict[str, type[Struct]]] = {"ping": Ping, "stop": StopNow, "estop": EstopNow}
"""All that the stop line knows."""


def describe_methods(methods: Mapping[str, type[Struct]] = REQUESTS) -> dict[str, dict[str, Any]]:
    """Return each method's sentence and the JSON Schema of its parameters."""
    return {
        name: {"does": _first_line(kind), "params": msgspec.json.schema(kind)}
        for name, kind in methods.items()
    }


def _first_line(kind: type[Struct]) -> str:
    return (kind.__doc__ or "").partition("\n")[0]
