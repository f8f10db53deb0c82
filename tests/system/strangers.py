"""Those who have no business at an encrypted socket, and what they get to hear there."""

import socket
import time
from collections.abc import Callable
from contextlib import suppress

import zmq

from legato.daemon.client import Client
from legato.daemon.keys import Keys
from legato.daemon.link import KeyRefused
from tests.system.junk import GREETING

QUIET_S = 0.3
NULL = GREETING + b"NULL".ljust(20, b"\0") + bytes(32)
READY = b"\x04\x19\x05READY\x0bSocket-Type\x00\x00\x00\x06DEALER"
STATUS = b'{"jsonrpc":"2.0","id":1,"method":"status"}'


def unlisted(keys: Keys) -> tuple[bytes, bytes, bytes]:
    """Return a pair of keys that nobody has listed."""
    public, secret = zmq.curve_keypair()
    return public, secret, keys.server


def mistaken(keys: Keys) -> tuple[bytes, bytes, bytes]:
    """Return a listed pair with another daemon's key."""
    return keys.public, keys.secret, zmq.curve_keypair()[0]


def plain(_: Keys) -> None:
    """Return no keys."""


STRANGERS: dict[str, Callable[[Keys], tuple[bytes, bytes, bytes] | None]] = {
    "unlisted": unlisted,
    "mistaken": mistaken,
    "plain": plain,
}


def refused(endpoint: str, who: str, keys: Keys, *, events: bool = False) -> float:
    """Ask as a stranger; return after how many seconds that was refused by name.

    Raises what else the client raises, AssertionError where it is let in.
    """
    made = STRANGERS[who](keys)
    own = Keys(*made) if made is not None else None
    began = time.monotonic()
    with Client(endpoint, endpoint if events else None, keys=own) as client:
        try:
            if events:
                next(client.events(5.0))
            else:
                client.call("ping")
        except KeyRefused:
            return time.monotonic() - began
        except StopIteration:
            raise AssertionError(f"{who} was not told") from None
    raise AssertionError(f"{who} was let in")


def overheard(endpoint: str) -> bytes:
    """Return all that a peer without encryption is sent, whatever it sends."""
    host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
    heard = b""
    with socket.create_connection((host, int(port)), 5.0) as made:
        made.settimeout(QUIET_S)
        body = bytes([0, len(STATUS)]) + STATUS + b"\x00\x01\x01"
        with suppress(OSError):
            made.sendall(NULL + READY + body)
            while data := made.recv(4096):
                heard += data
    return heard
