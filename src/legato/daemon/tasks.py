"""What the worker does besides jobs: referencing and reset, each with a number to answer it by."""

from legato.daemon.orders import DoReference, DoReset, Orders
from legato.geometry.motion import ToolPose


class Tasks:
    """The tasks of one worker; only a reset that nothing came after leaves the fault."""

    def __init__(self, orders: Orders) -> None:
        self._orders = orders
        self._token = 0
        self._reset: int | None = None
        self._gate_before = 0

    def reference(self, pose: ToolPose) -> int:
        """Let the worker take the arm to stand at a pose; return the task's number."""
        self._token += 1
        self._orders.give(DoReference(self._token, pose))
        return self._token

    def reset(self) -> int:
        """Let the worker see whether arm and camera answer; return the task's number."""
        self._token += 1
        self._reset, self._gate_before = self._token, self._orders.gate.number
        self._orders.give(DoReset(self._token))
        return self._token

    def give_up(self, token: int) -> None:
        """Forget a task that nobody waits for any more: its late success changes no state."""
        if token == self._reset:
            self._reset = None

    def break_off(self) -> int | None:
        """Forget the reset under way, if there is one, and return its number: an estop came."""
        token, self._reset = self._reset, None
        return token

    def ended(self, token: int, *, well: bool) -> bool:
        """Take in a task's end; say whether it leaves the fault, and then let motions pass again.

        An estop of the stop line that came after the reset was asked for keeps them back.
        """
        if token != self._reset:
            return False
        self._reset = None
        if well:
            self._orders.gate.reopen(self._gate_before)
        return well
