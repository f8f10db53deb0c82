"""Encrypted sockets: listed keys come in under their names, all others stay out and are told."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from queue import Queue

import pytest
import zmq

from legato.daemon.client import Client, KeyRefused
from legato.daemon.doorman import Doorman
from legato.daemon.keys import Keys, make_keys, read_clients, read_public, read_secret
from legato.daemon.messages import Message, TurnedAway
from legato.daemon.sockets import Sockets
from legato.daemon.who import Who

ANY = "tcp://127.0.0.1:*"
LINES = ("requests", "stop")


class Guarded:
    """Encrypted sockets, with the keys of the daemon, of two clients, and of a stranger."""

    def __init__(self, folder: Path) -> None:
        for name, role in (("anna", "operator"), ("ben", "observer")):
            make_keys(folder / "clients", name, role)
        secret, public = make_keys(folder, "cell", "server")
        self.folder = folder
        self.server = read_public(public, "").public.encode()
        self.heard: Queue[Message] = Queue()
        clients = read_clients(folder / "clients")
        doorman = Doorman(read_secret(secret, ""), clients, self.heard.put)
        self.sockets = Sockets(ANY, ANY, ANY, doorman)

    def keys(self, name: str, folder: str = "clients") -> Keys:
        """Return a client's keys."""
        own = read_secret(self.folder / folder / f"{name}.secret", "")
        return Keys(own.public, own.secret, self.server)

    def stranger(self) -> Keys:
        """Return keys that nobody has listed."""
        make_keys(self.folder, "eve", "operator")
        return self.keys("eve", ".")


@pytest.fixture
def guarded(tmp_path: Path) -> Iterator[Guarded]:
    """Give encrypted sockets on free ports."""
    made = Guarded(tmp_path)
    yield made
    made.sockets.close()


@pytest.mark.parametrize("line", LINES)
@pytest.mark.parametrize(("name", "role"), [("anna", "operator"), ("ben", "observer")])
def test_a_listed_key_comes_in_under_its_name(
    guarded: Guarded, line: str, name: str, role: str
) -> None:
    """Each message says who sent it, as the handshake has proved, and the answer goes back."""
    socket = getattr(guarded.sockets, line)
    with Client(guarded.sockets.endpoints[line], keys=guarded.keys(name)) as client:
        caller = client._connected()
        caller.socket.send(b"hello")
        assert socket.poll(5000)
        arrived = guarded.sockets.receive(socket)
        assert arrived is not None
        frames, who = arrived
        assert (frames[1:], who) == ([b"hello"], Who(name, role))
        socket.send_multipart([frames[0], b"well"])
        assert caller.socket.poll(5000)
    assert guarded.sockets.receive(socket) is None


@pytest.mark.parametrize("line", LINES)
def test_an_unlisted_key_is_refused_and_told(guarded: Guarded, line: str) -> None:
    """The client learns it at once; the daemon hears who was turned away; nothing comes in."""
    keys = guarded.stranger()
    with (
        Client(guarded.sockets.endpoints[line], timeout_s=30.0, keys=keys) as client,
        pytest.raises(KeyRefused, match="key refused"),
    ):
        client.call("ping")
    assert guarded.heard.get(timeout=5.0) == TurnedAway(
        "127.0.0.1", f"key {keys.public.decode()} is not listed"
    )
    assert guarded.sockets.receive(getattr(guarded.sockets, line)) is None


def test_an_unlisted_key_hears_no_events(guarded: Guarded) -> None:
    """A subscriber that may not come in is told instead of waiting in silence."""
    requests, events = guarded.sockets.endpoints["requests"], guarded.sockets.endpoints["events"]
    with Client(requests, events, keys=guarded.stranger()) as client:
        with pytest.raises(KeyRefused, match="key refused"):
            next(client.events(30.0))
        guarded.sockets.publish("state", b"{}")


def test_another_daemons_key_is_noticed(guarded: Guarded) -> None:
    """A client that trusts another daemon talks to no other."""
    keys = guarded.keys("anna")
    wrong = Keys(keys.public, keys.secret, zmq.curve_keypair()[0])
    with (
        Client(guarded.sockets.endpoints["requests"], timeout_s=30.0, keys=wrong) as client,
        pytest.raises(KeyRefused, match="key refused"),
    ):
        client.call("ping")
    assert isinstance(guarded.heard.get(timeout=5.0), TurnedAway)


def test_a_plain_client_is_refused_and_told(guarded: Guarded) -> None:
    """Without encryption nobody comes in, and both sides learn why."""
    endpoint = guarded.sockets.endpoints["requests"]
    with (
        Client(endpoint, timeout_s=30.0) as client,
        pytest.raises(KeyRefused, match="one side encrypts"),
    ):
        client.call("ping")
    assert "not encrypted" in str(guarded.heard.get(timeout=5.0))
    assert guarded.sockets.receive(guarded.sockets.requests) is None


def test_an_encrypted_client_does_not_talk_to_a_plain_daemon(guarded: Guarded) -> None:
    """What was meant to be secret is not sent in the clear."""
    keys = guarded.keys("anna")
    with closing(Sockets(ANY, ANY, ANY)) as plain:
        with (
            Client(plain.endpoints["requests"], timeout_s=30.0, keys=keys) as client,
            pytest.raises(KeyRefused, match="one side encrypts"),
        ):
            client.call("ping")
        assert plain.receive(plain.requests) is None


def test_a_port_that_is_taken_leaves_nothing_open(guarded: Guarded) -> None:
    """Where one socket cannot be bound the others are let go, threads included."""
    taken = guarded.sockets.endpoints["stop"]
    doorman = Doorman(guarded.keys("anna"), {}, lambda _: None)
    with pytest.raises(zmq.ZMQError, match="in use"):
        Sockets(ANY, ANY, taken, doorman)


def test_half_a_handshake_holds_nobody_up(guarded: Guarded) -> None:
    """Connections that say nothing, or nonsense, leave the door open for others."""
    import socket as plain

    host, port = guarded.sockets.endpoints["stop"].removeprefix("tcp://").split(":")
    odd = [plain.create_connection((host, int(port))) for _ in range(50)]
    for number, connection in enumerate(odd):
        connection.send(b"\xff\x00\x00\x00\x00\x00\x00\x00\x01\x7f"[: number % 11])
        connection.send(b"\x03\x00CURVE" if number % 3 else b"GET / HTTP/1.1\r\n\r\n")
    with Client(guarded.sockets.endpoints["stop"], keys=guarded.keys("anna")) as client:
        assert client._connected().endpoint == guarded.sockets.endpoints["stop"]
    for connection in odd:
        connection.close()
