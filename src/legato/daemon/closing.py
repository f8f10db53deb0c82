"""The end of the daemon, once asked for: the job retracts, the worker lets go, or has its time."""

from typing import Final

from legato.daemon.orders import Orders, Quit

LET_GO_S: Final = 5.0  # how long a worker may take to let go of what it does


class Closing:
    """An end that was asked for; times are monotonic s.

    A job has state stopping's deadline for its way off the leg, and is in fault after it.
    """

    def __init__(self, orders: Orders) -> None:
        self._orders = orders
        self._quit_at: float | None = None

    def over(self, now: float, *, running: bool) -> bool:
        """Say whether the worker has had its time; it is told to end once no job runs."""
        if running:
            return False
        if self._quit_at is None:
            self._quit_at = now
            self._orders.give(Quit())
        return now - self._quit_at > LET_GO_S
