"""The daemon's sockets: bound, limited in every direction, encrypted where keys are given.

A socket belongs to one thread at a time: requests and events to the loop, stop to the stop line.
"""

from contextlib import suppress
from typing import Final

import zmq

from legato.daemon.doorman import Doorman
from legato.daemon.who import LOCAL, Who
from legato.wire.jsonrpc import MAX_BYTES as LONGEST_REQUEST
from legato.wire.requests import TOPICS

HWM: Final = 1000
HANDSHAKE_MS: Final = 5000  # half a handshake holds a connection no longer
# A request that is too long is answered up to here; of what is longer still nothing is taken in,
# and ZeroMQ ends the connection.
MAX_BYTES: Final = 4 * LONGEST_REQUEST
# A subscription names a topic; libzmq keeps 40 bytes for each of its letters, whatever they are.
WISH_BYTES: Final = 1024
STOP_THREAD: Final = 2  # of ZeroMQ's two I/O threads, as a bit mask: the stop line has one alone

# ZeroMQ's flags as plain numbers: its own type costs a third of an answer's time.
EVENTS, POLLIN, RCVMORE = int(zmq.EVENTS), int(zmq.POLLIN), int(zmq.RCVMORE)
NOBLOCK = int(zmq.NOBLOCK)
MORE = NOBLOCK | int(zmq.SNDMORE)

Arrived = tuple[list[bytes], Who]


class Sockets:
    """The bound sockets; a port of `*` takes a free one, which the endpoints then name."""

    def __init__(
        self, requests: str, events: str, stop: str, doorman: Doorman | None = None
    ) -> None:
        self._context = zmq.Context(io_threads=2)
        self._context.setsockopt(zmq.MAX_SOCKETS, 64)
        self._doorman = doorman
        try:
            if doorman is not None:
                doorman.open(self._context)
            self.stop = self._bound(zmq.ROUTER, stop, affinity=STOP_THREAD)
            self.requests = self._bound(zmq.ROUTER, requests)
            self.events = self._bound(zmq.XPUB, events)
        except zmq.ZMQError:
            self._let_go()
            raise

    @property
    def endpoints(self) -> dict[str, str]:
        """Where the sockets listen."""
        return {
            "requests": _endpoint(self.requests),
            "events": _endpoint(self.events),
            "stop": _endpoint(self.stop),
        }

    def receive(self, socket: "zmq.Socket[bytes]") -> Arrived | None:
        """Return the next message that waits at a socket and who sent it; None where none does."""
        # Looking first is cheaper than the exception that an empty socket raises.
        return self.take(socket) if int(socket.get(EVENTS)) & POLLIN else None

    def take(self, socket: "zmq.Socket[bytes]") -> Arrived:
        """Return the next message of a socket at which one waits, and who sent it."""
        if self._doorman is None:
            frames = [socket.recv(NOBLOCK)]
            while socket.get(RCVMORE):
                frames.append(socket.recv(NOBLOCK))
            return frames, LOCAL
        parts = socket.recv_multipart(NOBLOCK, copy=False)
        return [part.bytes for part in parts], self._doorman.who(parts[-1])

    def send(self, frames: list[bytes]) -> None:
        """Answer a client; one that has gone or reads nothing is not waited for."""
        with suppress(zmq.ZMQError):
            for frame in frames[:-1]:
                self.requests.send(frame, MORE)
            self.requests.send(frames[-1], NOBLOCK)

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
        if len(frames) != 1 or kind not in (b"\x00", b"\x01") or not _begins_a_topic(prefix):
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
        for socket in (self.requests, self.stop):
            socket.close(linger=200)
        self.events.close(linger=0)
        if self._doorman is not None:
            self._doorman.close()
        self._context.term()

    def _let_go(self) -> None:
        if self._doorman is not None:
            self._doorman.close()
        self._context.destroy(linger=0)

    def _bound(self, kind: int, endpoint: str, *, affinity: int = 1) -> "zmq.Socket[bytes]":
        socket = self._context.socket(kind)
        socket.linger = 0
        socket.setsockopt(zmq.AFFINITY, affinity)
        socket.setsockopt(zmq.MAXMSGSIZE, WISH_BYTES if kind == zmq.XPUB else MAX_BYTES)
        socket.setsockopt(zmq.SNDHWM, HWM)
        socket.setsockopt(zmq.RCVHWM, HWM)
        socket.setsockopt(zmq.HANDSHAKE_IVL, HANDSHAKE_MS)
        if kind == zmq.XPUB:
            socket.setsockopt(zmq.XPUB_MANUAL, 1)
        if self._doorman is not None:
            self._doorman.guard(socket)
        socket.bind(endpoint)
        return socket


def _begins_a_topic(prefix: bytes) -> bool:
    return any(topic.encode().startswith(prefix) for topic in TOPICS)


def _endpoint(socket: "zmq.Socket[bytes]") -> str:
    return socket.getsockopt_string(zmq.LAST_ENDPOINT).rstrip("\0")
