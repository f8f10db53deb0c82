"""Follows a session to its end: bars on a terminal, lines in a pipe, Ctrl-C asks for a stop.

Events are for the eye; the outcome is asked of the daemon, so a lost event loses nothing.
"""

import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any, Protocol

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
)

from legato.cli.output import Output
from legato.report.lines import line_of

if TYPE_CHECKING:
    from legato.daemon.client import Client

SHOWN = ("state", "progress", "contact", "fault")
LISTEN_S = 0.1  # longest wait for an event, and so for a Ctrl-C to be heeded


class View(Protocol):
    """Where a session's progress is shown."""

    def show(self, topic: str, event: Mapping[str, Any]) -> None:
        """Show one event."""


class Lines:
    """A line an event, for a pipe."""

    def __init__(self, out: Output) -> None:
        self._out = out

    def show(self, topic: str, event: Mapping[str, Any]) -> None:
        """Print one event."""
        self._out.note(f"{topic:<8} {line_of(topic, event)}")


class Bars:
    """States as lines, strokes as a bar, for a terminal."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._task = progress.add_task("waiting", total=None)

    def show(self, topic: str, event: Mapping[str, Any]) -> None:
        """Take one event into the bar; contacts and faults stay as lines above it."""
        if topic == "state":
            self._progress.console.print(f"  {line_of(topic, event)}", markup=False)
            self._progress.update(self._task, description=str(event.get("state")))
        elif topic == "progress":
            self._progress.update(
                self._task,
                description=str(event.get("text")),
                completed=event.get("done") or 0,
                total=event.get("total"),
            )
        else:
            self._progress.console.print(f"    {line_of(topic, event)}", markup=False)


class Interrupts:
    """Counts Ctrl-C: the first is remembered, the second ends the command at once."""

    def __init__(self) -> None:
        self.asked = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Take one signal."""
        del number, frame
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True


@contextmanager
def interrupts() -> Iterator[Interrupts]:
    """Catch Ctrl-C for as long as this lasts."""
    heard = Interrupts()
    before = signal.signal(signal.SIGINT, heard)
    try:
        yield heard
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def view(out: Output) -> Iterator[View]:
    """Give the view that fits stderr."""
    if not out.terminal:
        yield Lines(out)
        return
    columns = (
        SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
        TimeElapsedColumn(),
    )  # fmt: skip
    with Progress(*columns, console=out.people, transient=True) as progress:
        yield Bars(progress)


def follow(client: "Client", session: str, out: Output) -> dict[str, Any]:
    """Show a session until it ends; return the daemon's answer to `wait`, with the outcome."""
    stopping = False
    with interrupts() as heard, view(out) as shown:
        while True:
            if heard.asked and not stopping:
                stopping = True
                out.note("stopping: the arm finishes its short motion and retracts")
                ask_stop(client, out)
            ended = _listen(client, session, shown, heard, stopping)
            answer = client.call("wait", session=session, timeout_s=0.0)
            if answer.get("outcome") is not None:
                _drain(client, session, shown, ended)
                return dict(answer)


def ask_stop(client: "Client", out: Output) -> None:
    """Ask for a stop; a refusal means that nothing runs any more."""
    from legato.daemon.client import RpcError

    try:
        client.call("stop")
    except RpcError as error:
        out.note(f"stop was refused: {error.message}")


def _listen(client: "Client", session: str, shown: View, heard: Interrupts, stopping: bool) -> bool:
    """Show events until there are none for a moment; True once the session's end was told."""
    for topic, event in client.events(LISTEN_S):
        # A new subscriber is first sent the last of each topic, also of earlier sessions.
        if topic in SHOWN and event.get("session") == session:
            shown.show(topic, event)
        if topic == "session" and event.get("id") == session and event.get("outcome"):
            return True
        if topic == "heartbeat" or (heard.asked and not stopping):
            return False
    return False


def _drain(client: "Client", session: str, shown: View, ended: bool) -> None:
    """Show what is still on its way of a session that has ended."""
    if not ended:
        _listen(client, session, shown, Interrupts(), True)
