"""A client of the daemon: requests matched by id, events without repeats, nothing that hangs.

After a time-out the socket is thrown away: a late answer must not be taken for the next one's.
One thread uses a client.
"""

import itertools
import time
from collections.abc import Iterator
from contextlib import suppress
from types import TracebackType
from typing import Any, Final, Self

import msgspec
import zmq

from legato.wire.requests import TOPICS

CONNECT_S: Final = 1.0
# These are answered when the devices have answered, or when the time that was asked for is up.
SLOW_S: Final = {"reset": 25.0, "reference": 25.0}
HWM: Final = 10_000


class DaemonUnavailable(Exception):
    """No daemon answers at an address, or not in time."""


class RpcError(Exception):
    """The daemon's refusal: code, its name, and data with reason, state and hint."""

    def __init__(self, code: int, message: str, data: dict[str, Any] | None = None) -> None:
        self.code = code
        self.message = message
        self.data = data or {}
        reason = self.data.get("reason")
        super().__init__(f"{message} ({code})" + (f": {reason}" if reason else ""))


class Client:
    """Calls methods at `requests` and listens at `events`, if given; both are endpoints."""

    def __init__(self, requests: str, events: str | None = None, timeout_s: float = 5.0) -> None:
        self._requests = requests
        self._events_at = events
        self._timeout_s = timeout_s
        self._ids = itertools.count(1)
        self._context = zmq.Context()
        self._caller: zmq.Socket[bytes] | None = None
        self._listener: zmq.Socket[bytes] | None = None
        self._heard = False
        self._boot: str | None = None
        self._last: dict[str, int] = {}
        if events is not None:
            self._listener = self._subscribed(events)

    def call(self, method: str, **params: Any) -> Any:
        """Return a method's result. Raises RpcError, DaemonUnavailable."""
        call_id = next(self._ids)
        request = {"jsonrpc": "2.0", "id": call_id, "method": method, "params": params}
        caller = self._connected()
        self._listen_first()
        caller.send(msgspec.json.encode(request))
        waits = self._timeout_s + SLOW_S.get(method, 0.0)
        if method == "wait":
            waits += float(params.get("timeout_s", 60.0))
        reply = self._reply(caller, call_id, waits)
        if "error" in reply:
            error = reply["error"]
            raise RpcError(int(error["code"]), str(error["message"]), error.get("data"))
        return reply["result"]

    def events(self, timeout_s: float) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield events as (topic, event) until `timeout_s` pass without one.

        What the daemon sends again for a newer subscriber is left out. A heartbeat comes every
        second, so a longer silence means that the daemon is gone.
        """
        if self._listener is None:
            raise ValueError("this client was made without the events' endpoint")
        while self._listener.poll(round(timeout_s * 1000.0)):
            self._heard = True
            topic, body = self._listener.recv_multipart()
            event = msgspec.json.decode(body)
            if self._is_new(topic.decode(), event):
                yield topic.decode(), event

    def close(self) -> None:
        """Let go of the sockets."""
        for socket in (self._caller, self._listener):
            if socket is not None:
                socket.close(linger=0)
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

    def _connected(self) -> "zmq.Socket[bytes]":
        """Return a socket that a daemon has accepted."""
        if self._caller is None:
            self._caller = self._context.socket(zmq.DEALER)
            self._caller.linger = 0
            # Nothing is queued for a daemon that is not there: it would act on it much later.
            self._caller.setsockopt(zmq.IMMEDIATE, 1)
            self._caller.connect(self._requests)
        if not self._caller.poll(round(min(CONNECT_S, self._timeout_s) * 1000.0), zmq.POLLOUT):
            self._drop()
            raise DaemonUnavailable(f"no daemon answers at {self._requests}")
        return self._caller

    def _reply(self, caller: "zmq.Socket[bytes]", call_id: int, timeout_s: float) -> dict[str, Any]:
        """Return the answer to a call; others are thrown away."""
        until = time.monotonic() + timeout_s
        while (left := until - time.monotonic()) > 0:
            if not caller.poll(max(1, round(left * 1000.0))):
                break
            with suppress(msgspec.DecodeError):
                reply = msgspec.json.decode(caller.recv_multipart()[-1])
                if isinstance(reply, dict) and reply.get("id") == call_id:
                    return reply
        self._drop()
        raise DaemonUnavailable(f"the daemon at {self._requests} has not answered in time")

    def _drop(self) -> None:
        if self._caller is not None:
            self._caller.close(linger=0)
            self._caller = None

    def _subscribed(self, events: str) -> "zmq.Socket[bytes]":
        listener = self._context.socket(zmq.SUB)
        listener.linger = 0
        listener.setsockopt(zmq.RCVHWM, HWM)
        # Each topic by itself: then the snapshot reaches this subscriber and nobody else.
        for topic in TOPICS:
            listener.setsockopt_string(zmq.SUBSCRIBE, topic)
        listener.connect(events)
        return listener

    def _listen_first(self) -> None:
        """See that the subscription stands before the first call causes events."""
        if self._listener is not None and not self._heard:
            self._heard = bool(self._listener.poll(round(CONNECT_S * 1000.0)))

    def _is_new(self, topic: str, event: dict[str, Any]) -> bool:
        """Say whether an event was not yet seen, and remember it."""
        boot, seq = str(event.get("boot")), int(event.get("seq", 0))
        if boot != self._boot:
            self._boot, self._last = boot, {}
        if seq <= self._last.get(topic, 0):
            return False
        self._last[topic] = seq
        return True
