"""The screen of `legato watch` beside a daemon that comes and goes."""

import io
import time
from collections.abc import Callable, Iterator
from typing import Any, cast

import pytest
from rich.console import Console

from legato.cli import watch
from legato.cli.command import Context, Services
from legato.cli.live import Live
from legato.cli.output import Output
from legato.daemon.client import Client, DaemonUnavailable
from tests.unit.cli.watched import STATES, seen, status


class Flaky:
    """A client whose daemon answers, dies, and comes back as another; then Ctrl-C."""

    def __init__(self) -> None:
        self.answers: list[Any] = [status(), DaemonUnavailable("gone"), status(boot="b2")]

    def call(self, method: str) -> Any:
        """Answer as told, in order."""
        if method == "describe":
            return {"states": STATES}
        if not self.answers:
            raise KeyboardInterrupt
        answer = self.answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def events(self, timeout_s: float) -> Iterator[tuple[str, dict[str, Any]]]:
        """Give nothing."""
        del timeout_s
        return iter(())


def test_the_screen_outlives_the_daemon() -> None:
    """A daemon that dies and another one that comes are both drawn; Ctrl-C ends it."""
    shown: list[str] = []

    def listen(client: Client, live: Live, draw: Callable[[], None]) -> None:
        del client
        draw()
        shown.append(live.link(time.monotonic()) + " " + str(live.boot))

    console = Console(width=100, height=30, force_terminal=True, file=io.StringIO())
    with pytest.raises(KeyboardInterrupt):
        watch.full_screen(cast(Client, Flaky()), "tcp://127.0.0.1:5760", console, listen)
    assert shown == ["live b1", "lost b1", "live b2"]


def test_events_are_taken_and_drawn_as_they_come() -> None:
    """Every event reaches the view; a fault ends the listening, so that its hint is asked for."""
    live, drawings = seen(), []
    live.take("heartbeat", {"boot": "b1", "state": "idle", "uptime_s": 1.0}, time.monotonic())

    class Telling(Flaky):
        def events(self, timeout_s: float) -> Iterator[tuple[str, dict[str, Any]]]:
            del timeout_s
            yield "state", {"boot": "b1", "state": "massage_7"}
            yield "state", {"boot": "b1", "state": "fault"}
            yield "state", {"boot": "b1", "state": "idle"}

    watch.hear(cast(Client, Telling()), live, lambda: drawings.append(live.state))
    assert live.state == "fault"
    assert drawings[-1] == "fault"


def test_lines_say_when_the_daemon_falls_silent_and_when_it_is_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Who reads a pipe learns of a daemon that is gone: once, and once when it is heard again."""
    clock = iter(float(10 * n) for n in range(100))
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))

    class Silent(Flaky):
        batches = 0

        def events(self, timeout_s: float) -> Iterator[tuple[str, dict[str, Any]]]:
            del timeout_s
            self.batches += 1
            if self.batches == 3:
                yield "state", {"boot": "b1", "state": "idle"}

    said: list[dict[str, Any]] = []

    class Kept(Output):
        def line(self, document: Any) -> None:
            said.append(document)

    context = Context(None, Kept(as_json=True), Services())
    watch.each_line(context, cast(Client, Silent()), False, 1)
    assert [(row["topic"], row.get("link")) for row in said] == [
        ("link", "stale"), ("link", "live"), ("state", None),
    ]  # fmt: skip
