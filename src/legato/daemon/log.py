"""The daemon's log, and the only home of structlog: JSON lines for the journal, colours for people.

Everything goes to stderr. Work that changes something is told at info, plain looking at debug.
Nobody waits for stderr: a line that it does not take, on a full disk or with nobody reading, is
lost and no more; the next that it takes is preceded by how many were.
"""

import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import cached_property
from typing import Any, Protocol, TextIO, cast

from legato.daemon.messages import Message, StopAnswered, StopLineBug, TurnedAway
from legato.daemon.outlet import Outlet


class Log(Protocol):
    """What the daemon's parts use of a logger: a short stable event name with fields."""

    def debug(self, event: str, **fields: Any) -> Any:
        """Tell what only matters when looking for an error."""

    def info(self, event: str, **fields: Any) -> Any:
        """Tell what was done."""

    def warning(self, event: str, **fields: Any) -> Any:
        """Tell what a person should look at."""

    def error(self, event: str, **fields: Any) -> Any:
        """Tell what has failed."""


def make_log(stream: TextIO | None = None, level: str = "info") -> Log:
    """Return a logger that writes to `stream` (stderr); other loggers stay as they are."""
    return _Late(stream if stream is not None else sys.stderr, level)


LOST = (OSError, ValueError)  # no room, nobody reads, closed


class _Late:
    """Loads structlog for its first line: it takes as long as all else that the daemon needs."""

    def __init__(self, out: TextIO, level: str) -> None:
        self._out = out
        self._level = level
        self._outlet = _outlet(out)

    @cached_property
    def _log(self) -> Log:
        import structlog

        shared: list[Any] = [
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
        ]
        if self._out.isatty():
            shared.append(structlog.dev.ConsoleRenderer())
        else:
            shared.append(structlog.processors.JSONRenderer())
        log: Log = structlog.wrap_logger(
            structlog.WriteLogger(cast(TextIO, self._outlet) if self._outlet else self._out),
            processors=shared,
            wrapper_class=structlog.make_filtering_bound_logger(self._level),
        )
        return log

    def debug(self, event: str, **fields: Any) -> None:
        if self._level == "debug":
            self._tell("debug", event, fields)

    def info(self, event: str, **fields: Any) -> None:
        self._tell("info", event, fields)

    def warning(self, event: str, **fields: Any) -> None:
        self._tell("warning", event, fields)

    def error(self, event: str, **fields: Any) -> None:
        self._tell("error", event, fields)

    def _tell(self, level: str, event: str, fields: Mapping[str, Any]) -> None:
        with suppress(*LOST):
            lost = self._outlet.take_lost() if self._outlet else 0
            if lost:
                self._log.warning("lines_lost", count=lost)
            getattr(self._log, level)(event, **fields)


def _outlet(stream: TextIO) -> Outlet | None:
    """Return the way to a stream that may keep its writer waiting, None for one in memory."""
    try:
        return Outlet(stream.fileno())
    except LOST:
        return None


def note(log: Log, message: Message) -> None:
    """Log what stop line and doorman have to tell; of others' messages nothing."""
    match message:
        case StopAnswered(told):
            log.info("stop_line", **told)
        case StopLineBug(text):
            log.error("bug", traceback=text)
        case TurnedAway(address, why):
            log.warning("turned_away", address=address, why=why)
