"""Whether the worker lives: it says what it does and how long that may take; the loop looks.

A driver's call that lasts longer than it may counts as dead, whatever the thread is waiting for.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import assert_never

from legato.control.effects import (
    Dwell,
    Effect,
    Enter,
    Find,
    Grab,
    Hold,
    Move,
    ReadArm,
    Record,
    Save,
    Solve,
)
from legato.control.states import CALIBRATE, CAPTURE, DEADLINES, VERIFY

SLACK_S = 5.0  # for the loop's answer, the disk, a machine that is busy with something else
ARM_SLACK_S = 2.0
OPENING_S = 60.0  # both devices, none of which answers
TASK_S = 60.0
WAITING_S = 10.0  # beyond what the worker waits for a task


@dataclass(frozen=True)
class Allowed:
    """How long each effect may take, in wall seconds; `slowness` is the wall's s per cell's s.

    `arm_s` and `camera_s` are the drivers' own time-outs.
    """

    arm_s: float = 1.0
    camera_s: float = 3.0
    slowness: float = 1.0

    def seconds(self, effect: Effect) -> float:
        """Return the time after which an effect counts as stuck."""
        match effect:
            case Move() | ReadArm():
                return 3.0 * self.slowness * self.arm_s + ARM_SLACK_S
            case Grab():
                # Trouble that passes is tried again until the state's deadline.
                return self.camera_s * self.slowness + DEADLINES[CAPTURE] + SLACK_S
            case Find():
                return DEADLINES[VERIFY] + SLACK_S
            case Solve():
                return DEADLINES[CALIBRATE] + SLACK_S
            case Dwell(seconds):
                return seconds * self.slowness + SLACK_S
            case Enter() | Record() | Save():
                return 2.0 * SLACK_S
            case Hold():
                return inf
            case _:
                assert_never(effect)


class Pulse:
    """The last promise that was made; one thread promises, any may look."""

    def __init__(
        self, allowed: Allowed | None = None, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.allowed = allowed if allowed is not None else Allowed()
        self._now = now
        self._promise = ("start", now() + OPENING_S)

    def promise(self, what: str, within_s: float) -> None:
        """Promise to be heard of again within some seconds."""
        self._promise = what, self._now() + within_s

    def overdue(self) -> str | None:
        """Return what has lasted longer than it may, None while all is well."""
        what, until = self._promise
        return what if self._now() > until else None
