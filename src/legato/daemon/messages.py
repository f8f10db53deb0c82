"""What worker, stop line and doorman tell the loop. Plain data; events in the past tense."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from legato.hal.faults import Cause

if TYPE_CHECKING:
    from legato.control.memory import Memory
    from legato.records.store import Summary


@dataclass(frozen=True)
class View:
    """What is known of arm, camera and leg: a copy that nobody changes any more.

    `arm` is ready for status; `picture_at` and `calibrated_at` are the cell's clock in s,
    `calibrated_in` is the session that found the leg. `memory` is None until the devices are known.
    """

    arm: Mapping[str, Any] = field(
        default_factory=lambda: {
            "connected": False,
            "referenced": False,
            "xyz_mm": None,
            "pitch_deg": None,
            "roll_deg": None,
            "contact": None,
        }
    )
    camera_connected: bool = False
    picture_at: float | None = None
    calibrated_at: float | None = None
    calibrated_in: str | None = None
    memory: "Memory | None" = None


@dataclass(frozen=True)
class FaultReport:
    """Why a job ended in fault, with what a person needs to find out more."""

    cause: Cause
    text: str
    hint: str
    evidence: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class DevicesKnown:
    """Arm and camera are open, or known to be missing; `older` sessions were read meanwhile."""

    view: View
    versions: Mapping[str, str]
    older: "Sequence[Summary]" = ()


@dataclass(frozen=True)
class Looked:
    """The worker has looked at the devices anew."""

    view: View


@dataclass(frozen=True)
class StateWanted:
    """A procedure asks to enter a state, and waits for the answer."""

    session: str
    state: str


@dataclass(frozen=True)
class Happened:
    """Something to publish and record: `kind` is a topic."""

    session: str
    kind: str
    data: Mapping[str, Any]


@dataclass(frozen=True)
class Moved:
    """The arm has moved: a look at it while a job runs, not recorded."""

    session: str
    view: View
    data: Mapping[str, Any]


@dataclass(frozen=True)
class JobEnded:
    """A job has ended; `outcome` is None where the loop itself took it from the worker."""

    session: str
    outcome: str | None
    reason: str | None
    cause: Cause | None
    fault: FaultReport | None
    view: View


@dataclass(frozen=True)
class TaskEnded:
    """Referencing or reset has ended; `problem` says why it failed, with a hint."""

    token: int
    view: View
    problem: tuple[str, str] | None = None


@dataclass(frozen=True)
class WorkerGone:
    """The worker has closed the devices and ended; `text` is its error, if it had one."""

    text: str | None = None


@dataclass(frozen=True)
class StopAnswered:
    """The stop line has answered a stop: its times, for the log."""

    told: Mapping[str, Any]


@dataclass(frozen=True)
class StopLineBug:
    """The stop line has met an error of its own and goes on."""

    text: str


@dataclass(frozen=True)
class TurnedAway:
    """Someone was refused at the door: from where, and why."""

    address: str
    why: str


Message = (
    DevicesKnown | Looked | StateWanted | Happened | Moved | JobEnded | TaskEnded | WorkerGone
    | StopAnswered | StopLineBug | TurnedAway
)  # fmt: skip
