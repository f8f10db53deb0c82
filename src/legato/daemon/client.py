"""A client of the daemon: requests matched by id, every event once, nothing that hangs.

After a time-out the socket is thrown away: a late answer must not be taken for the next one's.
A daemon that starts anew is found again by the next call. One thread uses a client.
"""

import itertools
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from types import TracebackType
from typing import Any, Final, Self

import msgspec
import zmq

from legato.control.table import ACTING, STOPS
from legato.daemon.keys import Keys
from legato.daemon.link import DaemonUnavailable, KeyRefused, Link, RpcError
from legato.daemon.sequence import AT_PRESENT, Event, Sequence
from legato.wire.jsonrpc import MAX_BYTES, too_long
from legato.wire.requests import TOPICS

__all__ = ["Client", "DaemonUnavailable", "KeyRefused", "RpcError"]

CONNECT_S: Final = 1.0
# These are answered when the devices have answered, or when the time that was asked for is up.
SLOW_S: Final = {"reset": 25.0, "reference": 25.0}
RENEWALS: Final = 3.0  # a lease is renewed so often before it ends


class Client:
    """Calls methods at `requests` and listens at `events`, if given; both are endpoints.

    With `keys` both lines are encrypted; a key that the daemon refuses raises KeyRefused, an
    RpcError. `requests` may be the stop line, which knows ping, stop and estop.
    """

    def __init__(
        self,
        requests: str,
        events: str | None = None,
        timeout_s: float = 5.0,
        keys: Keys | None = None,
    ) -> None:
        self._requests = requests
        self._timeout_s = timeout_s
        self._keys = keys
        self._ids = itertools.count(1)
        self._context = zmq.Context()
        self._caller: Link | None = None
        self._listener: Link | None = None
        self._heard = False
        self._sequence = Sequence(self._replayed)
        self._lease: str | None = None
        self._renewed_at = 0.0
        self._asked: dict[str, Any] = {}
        self._ahead_s: float | None = None
        if events is not None:
            self._listener = self._subscribed(events)

    @property
    def lost(self) -> int:
        """Events that were missed and could not be had again."""
        return self._sequence.lost

    def call(self, method: str, **params: Any) -> Any:
        """Return a method's result. Raises RpcError, DaemonUnavailable."""
        if method not in STOPS:
            self._listen_first()
            self._renew()
        if self._lease is not None and method in ACTING:
            params.setdefault("lease", self._lease)
        return self._call(method, params)

    def call_within(self, seconds: float, method: str, **params: Any) -> Any:
        """Return the result of an acting method that may not wait longer than so many seconds.

        Where the daemon cannot begin it by then, it is refused as expired and not carried out.
        """
        expires_at = time.monotonic() + seconds + self._ahead()
        return self.call(method, **params, expires_at=expires_at)

    def lease(self, duration_s: float = 10.0, *, deadman: bool = False) -> dict[str, Any]:
        """Take the lease: from now on this client alone may act.

        It is renewed by every call and while events are listened to, and by nothing else: a
        program that hangs loses it, and with `deadman` the arm then pauses.
        """
        self._asked = {"duration_s": duration_s, "deadman": deadman}
        return self._lease_told()

    def under(self, token: str) -> None:
        """Act under a lease that somebody else has taken, renews and ends."""
        self._lease, self._asked = token, {}

    def release(self) -> None:
        """End the lease before its time, if there is one."""
        token, self._lease = self._lease, None
        if token is not None:
            self._call("lease", {"lease": token, "duration_s": 0})

    def events(self, timeout_s: float) -> Iterator[Event]:
        """Yield events as (topic, event) until `timeout_s` pass without one.

        Each comes once, in its order; those that were missed are asked for and come first (see
        `lost`). A heartbeat comes every second, so a longer silence means that the daemon is gone.
        """
        if self._listener is None:
            raise ValueError("this client was made without the events' endpoint")
        until = time.monotonic() + timeout_s
        while (left := until - time.monotonic()) > 0 or timeout_s == 0:
            self._renew()
            if self._listener.wait(zmq.POLLIN, min(left, self._renew_in())):
                self._heard = True
                topic, body = self._listener.socket.recv_multipart()
                yield from self._sequence.take(topic.decode(), msgspec.json.decode(body))
                until = time.monotonic() + timeout_s
            elif timeout_s == 0:
                return

    def close(self) -> None:
        """Let go of the sockets; a lease ends by itself."""
        for link in (self._caller, self._listener):
            if link is not None:
                link.close()
        self._caller = self._listener = None
        self._context.term()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _call(self, method: str, params: Mapping[str, Any]) -> Any:
        call_id = next(self._ids)
        request = {"jsonrpc": "2.0", "id": call_id, "method": method, "params": params}
        waits = self._timeout_s + SLOW_S.get(method, 0.0)
        if method in ("wait", "stop", "estop"):
            waits += float(params.get("timeout_s", 60.0 if method == "wait" else 0.0))
        body = msgspec.json.encode(request)
        if len(body) > MAX_BYTES:
            no = too_long(len(body))
            raise RpcError(no.code, no.name, {"reason": no.reason, "hint": no.hint})
        try:
            caller = self._connected()
            caller.catch_up()
            caller.socket.send(body)
            reply = self._reply(caller, call_id, waits)
        except (DaemonUnavailable, KeyRefused):
            self._drop()
            raise
        if "error" in reply:
            error = reply["error"]
            raise RpcError(int(error["code"]), str(error["message"]), error.get("data"))
        return reply["result"]

    def _connected(self) -> Link:
        """Return a link that a daemon has accepted."""
        if self._caller is None:
            self._caller = Link(self._context, zmq.DEALER, self._requests, self._keys)
            # Nothing is queued for a daemon that is not there: it would act on it much later.
            self._caller.socket.setsockopt(zmq.IMMEDIATE, 1)
            self._caller.connect()
        if not self._caller.wait(zmq.POLLOUT, min(CONNECT_S, self._timeout_s)):
            raise DaemonUnavailable(f"no daemon answers at {self._requests}")
        return self._caller

    def _reply(self, caller: Link, call_id: int, timeout_s: float) -> dict[str, Any]:
        """Return the answer to a call; others are thrown away."""
        until = time.monotonic() + timeout_s
        while (left := until - time.monotonic()) > 0:
            if not caller.wait(zmq.POLLIN, left, heed_loss=True):
                break
            with suppress(msgspec.DecodeError):
                reply = msgspec.json.decode(caller.socket.recv_multipart()[-1])
                if isinstance(reply, dict) and reply.get("id") == call_id:
                    return reply
        raise DaemonUnavailable(f"the daemon at {self._requests} has not answered in time")

    def _drop(self) -> None:
        if self._caller is not None:
            self._caller.close()
            self._caller = self._ahead_s = None

    def _subscribed(self, events: str) -> Link:
        listener = Link(self._context, zmq.SUB, events, self._keys)
        # Each topic by itself: then the snapshot reaches this subscriber and nobody else.
        for topic in TOPICS:
            listener.socket.setsockopt_string(zmq.SUBSCRIBE, topic)
        listener.connect()
        return listener

    def _listen_first(self) -> None:
        """See that the subscription stands before the first call causes events."""
        if self._listener is not None and not self._heard:
            self._heard = self._listener.wait(zmq.POLLIN, CONNECT_S)
            told = self._replayed("any", AT_PRESENT)
            if told is not None:
                self._sequence.begin(str(told["boot"]), int(told["seq"]))

    def _replayed(self, boot: str, seq: int) -> Mapping[str, Any] | None:
        """Return the events after a number, None where the daemon cannot be asked."""
        try:
            found: Mapping[str, Any] = self._call("events_since", {"boot": boot, "seq": seq})
        except (DaemonUnavailable, RpcError):
            return None
        return found

    def _renew(self) -> None:
        """Renew the lease where it is time to; raises RpcError where it has ended."""
        if self._lease is not None and self._renew_in() <= 0:
            self._lease_told()

    def _renew_in(self) -> float:
        if self._lease is None or not self._asked:
            return float("inf")
        due = self._renewed_at + float(self._asked["duration_s"]) / RENEWALS
        return max(due - time.monotonic(), 0.0)

    def _lease_told(self) -> dict[str, Any]:
        """Take the lease or renew it."""
        began, token = time.monotonic(), {} if self._lease is None else {"lease": self._lease}
        try:
            told: dict[str, Any] = self._call("lease", {**self._asked, **token})
        except RpcError:
            self._lease = None
            raise
        self._lease, self._renewed_at = str(told["lease"]), began
        return told

    def _ahead(self) -> float:
        """Return how far the daemon's clock is ahead of ours, or a round trip less."""
        if self._ahead_s is None:
            self._ahead_s = float(self._call("ping", {})["now"]) - time.monotonic()
        return self._ahead_s
