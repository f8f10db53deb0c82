"""What the loop tells the worker: tasks, and the interrupts that every effect looks at first.

The loop never waits here. Once `drop` has returned, no motion command begins any more.
"""

import threading
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from legato.control.effects import PauseRequested, StopRequested
from legato.geometry.motion import ToolPose

if TYPE_CHECKING:
    from legato.records.session import SessionWriter


@dataclass(frozen=True)
class DoJob:
    """Carry out a job under a session's record."""

    session: str
    job: str
    writer: "SessionWriter"


@dataclass(frozen=True)
class DoReference:
    """Take the arm's present place to be `pose`."""

    token: int
    pose: ToolPose


@dataclass(frozen=True)
class DoReset:
    """See that arm and camera answer, opening them anew where they do not."""

    token: int


@dataclass(frozen=True)
class Quit:
    """Close the devices and end."""


Task = DoJob | DoReference | DoReset | Quit


class Dropped(Exception):
    """The loop has taken the job from the worker: no effect is performed any more."""


class Orders:
    """The meeting point of loop and worker; every method may be called from either's thread."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._tasks: deque[Task] = deque()
        self._wish: type[StopRequested | PauseRequested] | None = None
        self._dropped = False
        self._pausing = False
        self._resumed = False
        self._answer: bool | None = None

    # The loop's side.

    def give(self, task: Task) -> None:
        """Hand over a task to a worker that is free; wishes of an earlier one are forgotten.

        Only Quit may be given to a busy one: a job that was dropped stays so.
        """
        with self._changed:
            self._tasks.append(task)
            if not isinstance(task, Quit):
                self._wish, self._answer = None, None
                self._dropped = self._pausing = self._resumed = False
            self._changed.notify_all()

    def stop(self) -> None:
        """Ask the running procedure to retract and end."""
        with self._changed:
            self._wish = StopRequested
            self._changed.notify_all()

    def pause(self) -> None:
        """Ask the running procedure to retract and hold."""
        with self._changed:
            # Asked for twice, it must not break off the retract that the first has begun.
            if not self._pausing:
                self._wish = self._wish or PauseRequested
                self._pausing, self._resumed = True, False
                self._changed.notify_all()

    def resume(self) -> None:
        """Let a held procedure go on."""
        with self._changed:
            self._resumed = True
            self._changed.notify_all()

    def drop(self) -> None:
        """Let the worker send nothing more for the running task."""
        with self._changed:
            self._dropped = True
            self._changed.notify_all()

    def answer(self, granted: bool) -> None:
        """Answer the procedure that waits to enter a state."""
        with self._changed:
            self._answer = granted
            self._changed.notify_all()

    # The worker's side.

    def next_task(self, timeout: float) -> Task | None:
        """Return the next task, or None after `timeout` s without one."""
        with self._changed:
            self._changed.wait_for(lambda: self._tasks, timeout)
            return self._tasks.popleft() if self._tasks else None

    def look(self) -> None:
        """Raise Dropped, StopRequested or PauseRequested where one is due; each wish but once.

        Looked at last before a motion command: an estop answered earlier is not followed by one.
        """
        with self._changed:
            self._look()

    def entered(self) -> bool:
        """Wait for the answer to a wanted state; raises Dropped."""
        with self._changed:
            self._changed.wait_for(lambda: self._answer is not None or self._dropped)
            granted, self._answer = self._answer, None
            if self._dropped:
                raise Dropped
            return bool(granted)

    def hold(self) -> None:
        """Wait until the operator resumes; raises StopRequested or Dropped."""
        with self._changed:
            self._changed.wait_for(lambda: self._resumed or self._wish or self._dropped)
            self._look()
            self._pausing = self._resumed = False

    def _look(self) -> None:
        if self._dropped:
            raise Dropped
        wish, self._wish = self._wish, None
        if wish is not None:
            raise wish
