"""What a request says, in the cell's own terms; what it cannot mean is refused."""

import math
from typing import Any, Final

from legato.control.settings import CellSettings
from legato.geometry.arm import Unreachable, reach
from legato.geometry.motion import ToolPose
from legato.wire.jsonrpc import Failure
from legato.wire.requests import Acting, Job, Picking, Reference

FAR_MM: Final = 10_000.0  # from the base: farther off, and turned by more, no arm is asked about
TURNS_DEG: Final = 360.0


def in_time(request: Acting, now: float) -> None:
    """Raise Failure where a request has come too late to be what its sender wants."""
    if request.expires_at is not None and now > request.expires_at:
        late = now - request.expires_at
        raise Failure("expired", f"it came {late:.6g} s after its expires_at", "ask again")


def params_of(request: Job, settings: CellSettings) -> dict[str, Any]:
    """Return what a job is asked with beside its key; picks are of the leg's own marks."""
    if not isinstance(request, Picking) or request.picks is None:
        return {}
    marks = settings.leg.names()
    unknown = [name for name in request.picks if name not in marks]
    if unknown:
        hint = f"its marks are {', '.join(marks)}"
        raise Failure("invalid_params", f"the leg has no mark {unknown[0]}", hint)
    return {"picks": dict(request.picks)}


def pose_of(request: Reference, settings: CellSettings) -> ToolPose:
    """Return the pose that the operator tells, the configured start pose where nothing is."""
    _need_sense(request)
    start = settings.start
    x, y, z = request.xyz_mm if request.xyz_mm is not None else (start.x, start.y, start.z)
    pitch = start.pitch if request.pitch_deg is None else math.radians(request.pitch_deg)
    roll = start.roll if request.roll_deg is None else math.radians(request.roll_deg)
    try:
        reach(settings.arm, (x, y, z), pitch, roll)
    except Unreachable as error:
        hint = "give the pose at which the arm truly stands"
        raise Failure("invalid_params", f"the arm cannot stand there: {error}", hint) from error
    return ToolPose(x, y, z, pitch, roll, start.grip)


def _need_sense(request: Reference) -> None:
    """Raise Failure for a pose that no arm can have: so large a number is not reckoned with."""
    told = [("xyz_mm", value, FAR_MM) for value in request.xyz_mm or ()]
    told += [("pitch_deg", request.pitch_deg or 0.0, TURNS_DEG)]
    told += [("roll_deg", request.roll_deg or 0.0, TURNS_DEG)]
    for name, value, most in told:
        if abs(value) > most:
            reason = f"{name}: {value:g} is farther than {most:g} from 0"
            raise Failure("invalid_params", reason, "give the pose at which the arm stands")
