"""Junk thrown at all three sockets of a daemon and at its bare ports, with a look in between."""

import socket
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
import zmq

from legato.daemon.keys import Keys
from tests.system import junk
from tests.system.attacked import LINES, Attacked
from tests.system.line import Line

LOOKS = 20  # messages between two looks at status
ANEW = 40  # messages of one client before it is another
KINDS = ("requests", "stop", "events", "raw")


@dataclass
class Pelted:
    """What was thrown and how the daemon took it."""

    thrown: Counter[str] = field(default_factory=Counter)
    late_s: list[float] = field(default_factory=list)
    boots: set[str] = field(default_factory=set)
    megabytes: list[float] = field(default_factory=list)
    descriptors: list[int] = field(default_factory=list)


class Thrower:
    """Throws at one daemon; with `keys` its ZeroMQ messages come through the handshake."""

    def __init__(self, cell: Attacked, keys: Keys | None, seed: int) -> None:
        self._cell = cell
        self._keys = keys
        self._rng = np.random.default_rng(seed)
        self._context = zmq.Context()
        self._sockets: dict[str, zmq.Socket[bytes]] = {}
        self._raw: list[socket.socket] = []

    def throw(self) -> str:
        """Throw one message at one of the sockets; return at which."""
        where = str(self._rng.choice(KINDS))
        if where == "raw":
            self._throw_raw()
        else:
            self._throw_frames(where)
        return where

    def _throw_frames(self, where: str) -> None:
        if where not in self._sockets or self._rng.integers(ANEW) == 0:
            self._connect(where)
        frames = [junk.wish(self._rng)] if where == "events" else junk.message(self._rng)
        # One that was cut off for its size takes the next when it is connected again.
        with suppress(zmq.Again):
            self._sockets[where].send_multipart(frames)
        while self._sockets[where].poll(0):
            self._sockets[where].recv_multipart()

    def _connect(self, where: str) -> None:
        if where in self._sockets:
            self._sockets[where].close(linger=200)
        made = self._context.socket(zmq.XSUB if where == "events" else zmq.DEALER)
        made.setsockopt(zmq.SNDTIMEO, 2000)
        made.setsockopt(zmq.RECONNECT_IVL, 1)
        if self._keys is not None:
            made.setsockopt(zmq.CURVE_PUBLICKEY, self._keys.public)
            made.setsockopt(zmq.CURVE_SECRETKEY, self._keys.secret)
            made.setsockopt(zmq.CURVE_SERVERKEY, self._keys.server)
        made.connect(self._cell.lines[where])
        self._sockets[where] = made

    def _throw_raw(self) -> None:
        host, _, port = self._cell.lines[str(self._rng.choice(LINES))][6:].rpartition(":")
        made = socket.create_connection((host, int(port)), 5.0)
        with suppress(OSError):
            made.sendall(junk.raw(self._rng))
        if self._rng.random() < 0.3:
            self._raw.append(made)  # half a handshake that stays
        else:
            made.close()
        while len(self._raw) > 30:
            self._raw.pop(0).close()

    def close(self) -> None:
        """Let go of everything."""
        for made in self._raw:
            made.close()
        self._context.destroy(linger=200)


def pelt(cell: Attacked, count: int, keys: Keys | None = None, seed: int = 1) -> Pelted:
    """Throw `count` messages, looking at status between; keep its times, and what it held."""
    told, thrower = Pelted(), Thrower(cell, keys, seed)
    line = Line(cell.lines["requests"], keys)
    try:
        for number in range(count):
            told.thrown[thrower.throw()] += 1
            if number % LOOKS == 0:
                began = time.monotonic()
                status = line.do("status")
                told.late_s.append(time.monotonic() - began)
                told.boots.add(status["boot"])
            if number % max(count // 20, 1) == 0:
                told.megabytes.append(cell.megabytes())
                told.descriptors.append(cell.descriptors())
    finally:
        thrower.close()
        line.close()
    return told
