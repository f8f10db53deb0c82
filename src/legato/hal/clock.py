"""The cell's time: real seconds, or those of a simulated world that runs faster."""

from typing import Protocol


class Clock(Protocol):
    """Monotonic seconds of the cell, and waiting in them."""

    def monotonic(self) -> float:
        """Return seconds since some fixed moment."""

    def sleep(self, seconds: float) -> None:
        """Let `seconds` of the cell's time pass."""
