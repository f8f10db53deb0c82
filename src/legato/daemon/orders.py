"""What the loop tells the worker: tasks, and the interrupts that every effect looks at first.

The loop never waits here. After `drop` the worker sends nothing new; what the stop line asks for
stands in the gate, which needs no lock to be closed.
"""

import threading
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from legato.control.effects import PauseRequested, StopRequested
from legato.daemon.gate import Gate
from legato.daemon.trail import Trail
from legato.geometry.motion import ToolPose

if TYPE_CHECKING:
    from legato.records.session import SessionWriter


@dataclass(frozen=True)
class DoJob:
    """Carry out a job under a session's record; `params` is what else it was asked with."""

    session: str
    job: str
    writer: "SessionWriter"
    params: Mapping[str, Any] = field(default_factory=dict)


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

    def __init__(self, gate: Gate | None = None) -> None:
        self.gate = gate if gate is not None else Gate()
        self.trail = Trail()
        self._changed = threading.Condition()
        self._tasks: deque[Task] = deque()
        self._stop = False
        self._stopped = False
        self._since = 0
        self._dropped = False
        self._pause = False
        self._pausing = False
        self._resumed = False
        self._answer: bool | None = None

    # The loop's side.

    def give(self, task: Task, since: int | None = None) -> None:
        """Hand over a task to a worker that is free; wishes of an earlier one are forgotten.

        Stops that the gate was asked for up to number `since`, by default all, are not this task's.
        Only Quit may be given to a busy worker: a job that was dropped stays so.
        """
        with self._changed:
            self._tasks.append(task)
            if not isinstance(task, Quit):
                self._since = self.gate.number if since is None else since
                self._answer = None
                self._stop = self._stopped = self._dropped = False
                self._pause = self._pausing = self._resumed = False
            self._changed.notify_all()

    def stop(self) -> None:
        """Ask the running procedure to retract and end."""
        with self._changed:
            self._stop = True
            self._changed.notify_all()

    def pause(self) -> None:
        """Ask the running procedure to retract and hold."""
        with self._changed:
            # Asked for twice, it must not break off the retract that the first has begun.
            if not self._pausing:
                self._pause = self._pausing = True
                self._resumed = False
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

    def wake(self) -> None:
        """Let a worker that waits look at the gate."""
        with self._changed:
            self._changed.notify_all()

    # The worker's side.

    def next_task(self, timeout: float) -> Task | None:
        """Return the next task, or None after `timeout` s without one."""
        with self._changed:
            self._changed.wait_for(lambda: self._tasks, timeout)
            return self._tasks.popleft() if self._tasks else None

    def look(self) -> None:
        """Raise Dropped, StopRequested or PauseRequested where one is due; each wish but once."""
        with self._changed:
            self._look()

    @contextmanager
    def motion(self) -> Iterator[None]:
        """Enclose one motion command; raises what `look` raises, and then nothing is sent.

        The stop line confirms a stop when the enclosed call has ended.
        """
        self.gate.begin()
        try:
            self.look()
        except BaseException:
            self.gate.end()
            raise
        try:
            yield
        except BaseException as error:
            self.gate.end(str(error) or type(error).__name__)
            raise
        self.gate.end()

    def entered(self) -> bool:
        """Wait for the answer to a wanted state; raises Dropped."""
        with self._changed:
            self._changed.wait_for(lambda: self._answer is not None or self._is_dropped())
            granted, self._answer = self._answer, None
            if self._is_dropped():
                raise Dropped
            return bool(granted)

    def hold(self) -> None:
        """Wait until the operator resumes; raises StopRequested or Dropped."""
        with self._changed:
            self._changed.wait_for(lambda: self._resumed or self._must_stop() or self._is_dropped())
            self._look()
            self._pausing = self._resumed = False

    def _look(self) -> None:
        if self._is_dropped():
            raise Dropped
        if self._must_stop():
            # Once only: a second would break off the retract that the first has begun.
            self._stopped, self._pause = True, False
            raise StopRequested
        if self._pause:
            self._pause = False
            if not self._stopped:
                raise PauseRequested

    def _is_dropped(self) -> bool:
        return self._dropped or self.gate.closed

    def _must_stop(self) -> bool:
        asked = self.gate.stop
        return not self._stopped and (
            self._stop or (asked is not None and asked.number > self._since)
        )
