"""The lease: one client keeps the cell for a short while, renews it, or loses it by itself.

Whoever has the token has the lease. Times are monotonic s.
"""

import secrets
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from legato.daemon.log import Log
from legato.daemon.who import Who
from legato.wire.jsonrpc import Failure
from legato.wire.requests import Lease


@dataclass(frozen=True)
class Held:
    """A lease that somebody has, until `until` unless it is renewed."""

    token: str
    who: Who
    until: float
    deadman: bool


class Leases:
    """The one lease of the cell; the loop's thread alone uses it."""

    def __init__(self, log: Log, token: Callable[[], str] = lambda: secrets.token_hex(16)) -> None:
        self._log = log
        self._token = token
        self._held: Held | None = None
        self._unmanned: str | None = None

    def ask(self, request: Lease, who: Who, now: float) -> dict[str, Any]:
        """Take, renew or end the lease and return what the client is told; raises Failure."""
        held = self._held
        if request.lease is not None and (held is None or held.token != request.lease):
            raise Failure("expired", "this lease has ended", "ask for a new one, without a token")
        self.check(request.lease, who, now)
        if held is None or request.duration_s == 0:
            taken = request.duration_s > 0
            self._log.info("lease", by=who.name, taken=taken, deadman=request.deadman)
        if request.duration_s == 0:
            self._held = None
            return {"lease": None, "holder": None, "left_s": 0.0, "deadman": False}
        token = held.token if held is not None else self._token()
        self._held = Held(token, who, now + request.duration_s, request.deadman)
        return {"lease": token} | self._told(self._held, now)

    def check(self, token: str | None, who: Who, now: float) -> None:
        """Raise Failure where another has the lease; a token of an ended one is refused too."""
        held = self._held
        if held is None:
            if token is not None:
                hint = "see status, ask for a new lease, then ask again"
                raise Failure("expired", "the lease that this was asked under has ended", hint)
        elif token != held.token or who.name != held.who.name:
            left = max(held.until - now, 0.0)
            reason = f"{held.who.name} has the lease for another {left:.1f} s"
            raise Failure("busy", reason, "wait for its end; stop and estop need no lease")

    def manned(self, name: str) -> bool:
        """Say whether a client holds the lease with a deadman."""
        held = self._held
        return held is not None and held.deadman and held.who.name == name

    def need_for(self, name: str, *, manned: bool) -> None:
        """Raise Failure where what a client began earlier must not go on by itself.

        Another has the lease now; or, where it was `manned`, the lease with a deadman has ended.
        """
        held = self._held
        if held is not None and held.who.name != name:
            raise Failure("busy", f"{held.who.name} has the lease", "ask for it again afterwards")
        if manned and not self.manned(name):
            raise Failure("expired", f"the lease of {name} with a deadman has ended", "begin anew")

    def unmanned(self, now: float, *, running: bool, pausable: bool) -> str | None:
        """Return who has lost a lease with a deadman, once, as soon as the arm can be paused.

        A lease that has ended for want of renewal ends here. Where nothing is running, nobody is
        missed.
        """
        held = self._held
        if held is None and self._unmanned is None:
            return None
        if held is not None and now >= held.until:
            self._held = None
            self._log.warning("lease_lost", by=held.who.name, deadman=held.deadman)
            if held.deadman:
                self._unmanned = held.who.name
        if not running:
            self._unmanned = None
        if self._unmanned is None or not pausable:
            return None
        name, self._unmanned = self._unmanned, None
        return name

    def next_due(self) -> float:
        """Return when the lease ends."""
        return self._held.until if self._held is not None else float("inf")

    def told(self, now: float) -> dict[str, Any] | None:
        """Return what status tells, without the token."""
        return self._told(self._held, now) if self._held is not None else None

    def _told(self, held: Held, now: float) -> dict[str, Any]:
        left = round(max(held.until - now, 0.0), 3)
        return {"holder": held.who.name, "left_s": left, "deadman": held.deadman}
