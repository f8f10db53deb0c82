"""Who may come in: ZeroMQ's authentication requests (ZAP, RFC 27) answered from the listed keys.

A key that is not listed is told so by libzmq with status 400, and comes no further. The thread
reads no disk: the keys are those that it was made with.
"""

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from math import ceil, inf
from typing import Final

import zmq
from zmq.utils import z85
from zmq.utils.monitor import recv_monitor_message

from legato.daemon.keys import Keys
from legato.daemon.mailbox import Bell
from legato.daemon.messages import Message
from legato.daemon.refusals import Refusals
from legato.daemon.who import NOBODY, Who

ZAP: Final = "inproc://zeromq.zap.01"
DOMAIN: Final = b"legato"
NO_HANDSHAKE: Final = zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL


class Doorman:
    """Guards sockets with the server's `keys`; `clients` are those who may come in, by public key.

    `post` tells the loop of those who may not.
    """

    def __init__(
        self, keys: Keys, clients: Mapping[bytes, Who], post: Callable[[Message], None]
    ) -> None:
        self._keys = keys
        self._clients = dict(clients)
        self._by_name = {who.name: who for who in clients.values()}
        self._post = post
        self._refusals = Refusals()
        self._bell = Bell()
        self._ended = False
        self._door: zmq.Socket[bytes] | None = None
        self._watched: list[zmq.Socket[bytes]] = []
        self._thread = threading.Thread(target=self._run, name="doorman", daemon=True)

    def open(self, context: "zmq.Context[zmq.Socket[bytes]]") -> None:
        """Stand at the door; before any guarded socket is bound, or libzmq lets everyone in."""
        self._door = context.socket(zmq.REP)
        self._door.linger = 0
        self._door.bind(ZAP)
        self._thread.start()

    def guard(self, socket: "zmq.Socket[bytes]") -> None:
        """Let nobody into a socket, not yet bound, but through this door."""
        socket.setsockopt(zmq.CURVE_SERVER, 1)
        socket.setsockopt(zmq.CURVE_SECRETKEY, self._keys.secret)
        socket.setsockopt(zmq.CURVE_PUBLICKEY, self._keys.public)
        socket.setsockopt(zmq.ZAP_DOMAIN, DOMAIN)
        self._watched.append(socket.get_monitor_socket(NO_HANDSHAKE))
        self._bell.ring()

    def who(self, frame: zmq.Frame) -> Who:
        """Return who sent a message, as the handshake has proved."""
        with suppress(zmq.ZMQError):
            return self._by_name.get(str(frame.get("User-Id")), NOBODY)
        return NOBODY

    def close(self) -> None:
        """Leave the door: nobody comes in any more."""
        self._ended = True
        self._bell.ring()
        if self._thread.ident is not None:
            self._thread.join()
        for monitor in self._watched:
            monitor.close(linger=0)
        if self._door is not None:
            self._door.close(linger=0)
        self._bell.close()

    def _run(self) -> None:
        assert self._door is not None
        while not self._ended:
            poller = zmq.Poller()
            poller.register(self._bell.fileno(), zmq.POLLIN)
            poller.register(self._door, zmq.POLLIN)
            watched = list(self._watched)
            for monitor in watched:
                poller.register(monitor, zmq.POLLIN)
            heard = dict(poller.poll(self._patience_ms()))
            self._bell.silence()
            if self._door in heard:
                self._door.send_multipart(self._answer(self._door.recv_multipart()))
            for monitor in watched:
                if monitor in heard:
                    self._turned_away(monitor)
            self._tell_due(time.monotonic())
        self._tell_due(inf)

    def _answer(self, request: list[bytes]) -> list[bytes]:
        """Return the answer to an authentication request, whatever it is."""
        version, number, domain, address, _, mechanism, *rest = (*request, *[b""] * 7)[:7]
        key = z85.encode(rest[0]) if rest and len(rest[0]) == 32 else b""
        who = self._clients.get(key) if (mechanism, domain) == (b"CURVE", DOMAIN) else None
        if who is not None:
            return [version, number, b"200", b"OK", who.name.encode(), b""]
        kind, why = ("key", f"key {key.decode()} is not listed") if key else ("none", "no key")
        self._refuse(address.decode("ascii", "replace"), kind, why)
        return [version, number, b"400", b"key refused", b"", b""]

    def _turned_away(self, monitor: "zmq.Socket[bytes]") -> None:
        event = recv_monitor_message(monitor)
        why = "not encrypted, or with another server key"
        self._refuse(event["endpoint"].decode("ascii", "replace"), "handshake", why)

    def _refuse(self, address: str, kind: str, why: str) -> None:
        told = self._refusals.take(address, kind, why, time.monotonic())
        if told is not None:
            self._post(told)

    def _tell_due(self, now: float) -> None:
        for told in self._refusals.take_due(now):
            self._post(told)

    def _patience_ms(self) -> int | None:
        """Return how long nobody has to come before there is something to tell."""
        due = self._refusals.next_due()
        return None if due == inf else max(ceil((due - time.monotonic()) * 1000.0), 0)
