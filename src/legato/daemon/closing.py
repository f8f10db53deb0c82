"""The end of the daemon, once asked for: the job retracts, the worker lets go, or has its time."""

from typing import Final

from legato.daemon.orders import Orders, Quit

LET_GO_S: Final = 5.0  # how long a worker may take to let go of what it does
TOLD = "the daemon was told to end"
CLOSE_S: Final = 20.0  # how long a running job may take to retract at the end of the daemon


class Closing:
    """An end that was asked for at `since`; times are monotonic s."""

    def __init__(self, orders: Orders, since: float) -> None:
        self._orders = orders
        self._since = since
        self._quit_at: float | None = None

    def gives_up(self, now: float, *, running: bool) -> bool:
        """Say whether a running job has had its time; then nothing more of it is sent."""
        late = running and now - self._since >= CLOSE_S
        if late:
            self._orders.drop()
        return late

    def over(self, now: float, *, running: bool) -> bool:
        """Say whether the worker has had its time; it is told to end once no job runs."""
        if running:
            return False
        if self._quit_at is None:
            self._quit_at = now
            self._orders.give(Quit())
        return now - self._quit_at > LET_GO_S
