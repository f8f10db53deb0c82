"""The loop: one poller over requests, subscriptions and the worker's mailbox, in the main thread.

It alone owns the sockets. Every message is handled alone, and nothing that comes in ends it.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from math import ceil

import zmq

from legato.daemon.conductor import Conductor
from legato.daemon.desk import Desk
from legato.daemon.events import Events
from legato.daemon.mailbox import Mailbox
from legato.wire.jsonrpc import MAX_BYTES

HWM = 1000
BATCH = 64  # messages of one socket handled before the others have their turn


class Sockets:
    """The bound sockets; a port of `*` takes a free one, which the endpoints then name."""

    def __init__(self, requests: str, events: str) -> None:
        self._context = zmq.Context()
        self._context.setsockopt(zmq.MAX_SOCKETS, 64)
        try:
            self.requests = self._bound(zmq.ROUTER, requests)
            self.events = self._bound(zmq.XPUB, events)
        except zmq.ZMQError:
            self._context.destroy(linger=0)
            raise

    @property
    def endpoints(self) -> dict[str, str]:
        """Where the sockets listen."""
        return {
            "requests": _endpoint(self.requests),
            "events": _endpoint(self.events),
        }

    def send(self, frames: list[bytes]) -> None:
        """Answer a client; one that has gone or reads nothing is not waited for."""
        with suppress(zmq.ZMQError):
            self.requests.send_multipart(frames, flags=zmq.NOBLOCK)

    def publish(self, topic: str, body: bytes) -> None:
        """Publish to all who want the topic; who is too slow loses it."""
        with suppress(zmq.ZMQError):
            self.events.send_multipart([topic.encode(), body], flags=zmq.NOBLOCK)

    def wish(self) -> tuple[str, bytes] | None:
        """Take in the next waiting subscription: what it is, its prefix; None where none waits.

        It is `wanted`, `unwanted` or `junk`.
        """
        try:
            frames = self.events.recv_multipart(flags=zmq.NOBLOCK)
        except zmq.Again:
            return None
        kind, prefix = frames[0][:1], frames[0][1:]
        if len(frames) != 1 or kind not in (b"\x00", b"\x01"):
            return "junk", b""
        wanted = kind == b"\x01"
        self.events.setsockopt(zmq.SUBSCRIBE if wanted else zmq.UNSUBSCRIBE, prefix)
        return "wanted" if wanted else "unwanted", prefix

    def snapshot(self, latest: list[tuple[str, bytes]]) -> None:
        """Give the latest subscriber what it missed.

        ZeroMQ can aim the first message only; a subscription that takes in several topics makes
        the others reach everyone again, with the numbers that they had.
        """
        for number, (topic, body) in enumerate(latest):
            if number == 0:
                self.events.setsockopt(zmq.XPUB_MANUAL_LAST_VALUE, 1)
            self.publish(topic, body)
            if number == 0:
                self.events.setsockopt(zmq.XPUB_MANUAL_LAST_VALUE, 0)
                self.events.setsockopt(zmq.XPUB_MANUAL, 1)

    def close(self) -> None:
        """Let go of the sockets; what is still to be sent is given a moment to leave."""
        # A last answer, to shutdown itself, is in the socket's queue.
        self.requests.close(linger=200)
        self.events.close(linger=0)
        self._context.term()

    def _bound(self, kind: int, endpoint: str) -> "zmq.Socket[bytes]":
        socket = self._context.socket(kind)
        socket.linger = 0
        socket.setsockopt(zmq.MAXMSGSIZE, MAX_BYTES)
        socket.setsockopt(zmq.SNDHWM, HWM)
        socket.setsockopt(zmq.RCVHWM, HWM)
        if kind == zmq.XPUB:
            socket.setsockopt(zmq.XPUB_MANUAL, 1)
        socket.bind(endpoint)
        return socket


class Loop:
    """Polls, and hands each message to the one that knows what to do.

    `ready` is called once, when the devices are known.
    """

    def __init__(
        self,
        sockets: Sockets,
        mailbox: Mailbox,
        conductor: Conductor,
        desk: Desk,
        events: Events,
        ready: Callable[[], None] = lambda: None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._sockets = sockets
        self._mailbox = mailbox
        self._conductor = conductor
        self._desk = desk
        self._events = events
        self._ready = ready
        self._was_ready = False
        self._now = now
        self._poller = zmq.Poller()
        self._poller.register(sockets.requests, zmq.POLLIN)
        self._poller.register(sockets.events, zmq.POLLIN)
        self._poller.register(mailbox.fileno(), zmq.POLLIN)

    def run(self, end: Callable[[], bool] = lambda: False) -> None:
        """Serve until the conductor has finished; once `end()` says so, the end begins."""
        while not self._conductor.finished:
            self.turn()
            if end():
                self._conductor.shutdown()

    def turn(self) -> None:
        """Wait for what comes next, and handle all that has come."""
        due = min(self._conductor.next_due(), self._desk.next_due())
        self._poller.poll(ceil(max(due - self._now(), 0.0) * 1000.0))
        self._conductor.tick(self._now())
        for message in self._mailbox.drain():
            self._conductor.receive(message)
        self._requests()
        self._subscriptions()
        self._conductor.tick(self._now())
        self._desk.settle(self._now())
        if self._conductor.devices_known and not self._was_ready:
            self._was_ready = True
            self._ready()

    def _requests(self) -> None:
        for frames in _received(self._sockets.requests, BATCH):
            self._desk.receive(frames, self._now())

    def _subscriptions(self) -> None:
        for _ in range(BATCH):
            wish = self._sockets.wish()
            if wish is None:
                return
            kind, prefix = wish
            if kind == "wanted":
                self._sockets.snapshot(self._events.latest(prefix.decode("latin-1")))
            elif kind == "junk":
                self._desk.junk += 1


def _received(socket: "zmq.Socket[bytes]", most: int) -> list[list[bytes]]:
    """Return the messages that wait at a socket, not more than `most`."""
    found: list[list[bytes]] = []
    with suppress(zmq.Again):
        while len(found) < most:
            found.append(socket.recv_multipart(flags=zmq.NOBLOCK))
    return found


def _endpoint(socket: "zmq.Socket[bytes]") -> str:
    return socket.getsockopt_string(zmq.LAST_ENDPOINT).rstrip("\0")
