"""The daemon's log, and the only home of structlog: JSON lines for the journal, colours for people.

Everything goes to stderr. Work that changes something is told at info, plain looking at debug.
"""

import sys
from typing import Any, Protocol, TextIO

import structlog


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
    out = stream if stream is not None else sys.stderr
    shared: list[Any] = [
        structlog.processors.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]
    if out.isatty():
        shared.append(structlog.dev.ConsoleRenderer())
    else:
        shared.append(structlog.processors.JSONRenderer())
    log: Log = structlog.wrap_logger(
        structlog.PrintLogger(out),
        processors=shared,
        wrapper_class=structlog.make_filtering_bound_logger(level),
    )
    return log
