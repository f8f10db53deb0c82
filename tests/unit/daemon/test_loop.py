"""The loop on real sockets: any client's frames, subscriptions, junk; one thread, no real time."""

import json
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zmq

from legato.daemon import sockets
from legato.daemon.gate import present
from legato.daemon.loop import Loop
from legato.daemon.mailbox import Mailbox
from legato.daemon.messages import WorkerGone
from legato.daemon.sockets import Sockets
from legato.wire.jsonrpc import MAX_BYTES
from legato.wire.requests import TOPICS
from tests.unit.daemon.house import House

ANY = "tcp://127.0.0.1:*"


class Served:
    """A loop that turns when the test says so, and its clients."""

    def __init__(self, folder: Path) -> None:
        self.sockets = Sockets(ANY, ANY, ANY)
        self.house = House(
            folder,
            now=time.monotonic(),
            on_send=self.sockets.send,
            on_publish=self.sockets.publish,
        ).known()
        self.mailbox = Mailbox()
        self.ready: list[bool] = []
        self.loop = Loop(
            self.sockets,
            self.mailbox,
            self.house.conductor,
            self.house.desk,
            self.house.published,
            lambda: self.ready.append(True),
        )
        self.context = zmq.Context()
        self.clients: list[zmq.Socket[bytes]] = []

    def client(self, kind: int) -> "zmq.Socket[bytes]":
        """Return a plain client of the requests."""
        socket = self.context.socket(kind)
        socket.linger = 0
        socket.connect(self.sockets.endpoints["requests"])
        self.clients.append(socket)
        return socket

    def subscriber(self, *topics: str) -> "zmq.Socket[bytes]":
        """Return a plain subscriber whose snapshot is on its way."""
        socket = self.context.socket(zmq.SUB)
        socket.linger = 0
        for topic in topics:
            socket.setsockopt_string(zmq.SUBSCRIBE, topic)
        socket.connect(self.sockets.endpoints["events"])
        self.clients.append(socket)
        assert self.turn_until(lambda: bool(socket.poll(0)))
        return socket

    def turn_until(self, done: Callable[[], bool]) -> bool:
        """Turn the loop until something is so; at most some seconds' worth of heartbeats."""
        for _ in range(200):
            os.write(self.mailbox.wake_fileno(), b"w")  # as a signal does
            self.loop.turn()
            if done():
                return True
            time.sleep(0.005)
        return False

    def answer(self, socket: "zmq.Socket[bytes]", *frames: bytes) -> dict[str, Any]:
        """Send frames and return the answer."""
        socket.send_multipart(frames)
        assert self.turn_until(lambda: bool(socket.poll(0)))
        found: dict[str, Any] = json.loads(socket.recv_multipart()[-1])
        return found

    def events(self, socket: "zmq.Socket[bytes]") -> list[tuple[str, dict[str, Any]]]:
        """Return what has come to a subscriber so far."""
        found = []
        while socket.poll(100):
            topic, body = socket.recv_multipart()
            found.append((topic.decode(), json.loads(body)))
        return found

    def close(self) -> None:
        """Let go of everything."""
        for socket in self.clients:
            socket.close(linger=0)
        self.context.term()
        self.house.close()
        self.sockets.close()
        self.mailbox.close()


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    """Give a loop on free ports."""
    made = Served(tmp_path)
    yield made
    made.close()


def ping(call_id: object = 1) -> bytes:
    """Return a request's bytes."""
    return json.dumps({"jsonrpc": "2.0", "id": call_id, "method": "ping"}).encode()


@pytest.mark.parametrize("kind", [zmq.REQ, zmq.DEALER])
def test_req_and_dealer_clients_both_work(served: Served, kind: int) -> None:
    """A client needs nothing but JSON-RPC in one frame."""
    answer = served.answer(served.client(kind), ping("me"))
    assert (answer["id"], answer["result"]["boot"]) == ("me", "boot")


def test_odd_frames_do_no_harm(served: Served) -> None:
    """Frames of any number and content are answered or dropped, and the next request is served."""
    dealer = served.client(zmq.DEALER)
    for frames in ([b""], [b"", b""], [b"a", b"b", b"c"], [b"", b"a", b"b"], [b"\xff" * 100]):
        assert "error" in served.answer(dealer, *frames)
    dealer.send(b"x" * (sockets.MAX_BYTES + 1))
    assert served.answer(served.client(zmq.REQ), ping())["result"]["state"] == "idle"
    assert served.house.desk.junk == 5


def test_a_request_that_is_too_long_is_told_so(served: Served) -> None:
    """By its id, with the limit; the next one of the same client is served."""
    dealer = served.client(zmq.DEALER)
    for size in (MAX_BYTES, sockets.MAX_BYTES - 200):
        body = ping("me")[:-1] + b', "params": {"x": "' + b"y" * size + b'"}}'
        answer = served.answer(dealer, body)
        assert answer["id"] == "me"
        assert answer["error"]["message"] == "invalid_request"
        assert f"{len(body)} bytes, at most {MAX_BYTES}" in answer["error"]["data"]["reason"]
    assert served.answer(dealer, ping())["result"]["state"] == "idle"


def test_junk_on_the_events_socket_does_no_harm(served: Served) -> None:
    """A subscriber that talks is counted, not obeyed."""
    talker = served.context.socket(zmq.XSUB)
    talker.linger = 0
    talker.connect(served.sockets.endpoints["events"])
    served.clients.append(talker)
    talker.send(b"\x02 hello")
    talker.send_multipart([b"\x01state", b"more"])
    assert served.turn_until(lambda: served.house.desk.junk >= 1)
    assert served.answer(served.client(zmq.REQ), ping())["result"]["state"] == "idle"


def test_a_subscription_that_names_no_topic_is_not_kept(served: Served) -> None:
    """For each letter of one libzmq keeps memory: what no topic begins with is junk, or cut off."""
    talker = served.context.socket(zmq.XSUB)
    talker.linger = 0
    talker.connect(served.sockets.endpoints["events"])
    served.clients.append(talker)
    talker.send(b"\x01nothing")
    assert served.turn_until(lambda: served.house.desk.junk >= 1)
    assert int(served.sockets.events.getsockopt(zmq.MAXMSGSIZE)) < 2000


def test_a_new_subscriber_gets_the_latest_of_each_topic(served: Served) -> None:
    """Late as it is, it knows the state and the last heartbeat at once."""
    session = served.house.begin("home")
    assert session
    served.house.pass_time(2.0)
    late = served.subscriber("")
    topics = [topic for topic, _ in served.events(late)]
    assert topics[0] == "state"
    assert set(topics) == {"state", "session", "heartbeat"}


def test_a_snapshot_does_not_disturb_others(served: Served) -> None:
    """Who subscribes topic by topic gets the latest without sending it to everyone again."""
    first = served.subscriber(*TOPICS)
    served.house.begin("home")
    served.turn_until(lambda: True)
    before = served.events(first)
    assert [e["state"] for t, e in before if t == "state"] == ["idle", "move_home"]
    second = served.subscriber(*TOPICS)
    assert "state" in [t for t, _ in served.events(second)]
    assert [t for t, _ in served.events(first) if t != "heartbeat"] == []


def test_all_subscribers_get_what_follows_a_snapshot(served: Served) -> None:
    """After one subscriber's snapshot, and its leaving, the next event reaches all the others."""
    first, second = served.subscriber("state"), served.subscriber("contact", "state")
    third = served.subscriber("state")
    third.setsockopt_string(zmq.UNSUBSCRIBE, "state")
    served.turn_until(lambda: True)
    third.close(linger=0)
    for socket in (first, second):
        served.events(socket)
    served.turn_until(lambda: True)
    served.house.begin("home")
    assert served.turn_until(lambda: bool(first.poll(0)) and bool(second.poll(0)))
    assert [e["state"] for _, e in served.events(first)] == ["move_home"]
    assert [e["state"] for _, e in served.events(second)] == ["move_home"]


def test_a_subscriber_that_does_not_read_slows_nobody(served: Served) -> None:
    """Thousands of events beside a stalled subscriber: the others get all of them, in order."""
    stalled, reader = served.subscriber("progress", "state"), served.subscriber("contact", "state")
    served.events(reader)
    for number in range(3000):
        served.house.published.emit("progress", None, {"number": number})
    for number in range(500):
        served.house.published.emit("contact", None, {"number": number})
    seqs = [e["seq"] for t, e in served.events(reader) if t == "contact"]
    assert len(seqs) == 500
    assert seqs == sorted(seqs)
    assert stalled.poll(0)


def test_a_stop_ends_no_job_that_was_asked_for_after_it(served: Served) -> None:
    """Who has heard that a stop is confirmed sends a job, in the same turn of the loop: it runs."""
    client = served.client(zmq.DEALER)
    client.send(ping())
    assert served.turn_until(lambda: bool(client.poll(0)))
    client.recv()
    gate = served.house.conductor.gate

    def confirmed() -> None:
        if not served.sockets.requests.poll(0):
            client.send(json.dumps({"jsonrpc": "2.0", "id": 2, "method": "home"}).encode())
        assert served.sockets.requests.poll(2000)

    gate.ring = confirmed
    gate.ask("anna", present(), estop=False)
    assert served.turn_until(lambda: bool(client.poll(0)))
    assert json.loads(client.recv())["result"]["state"] == "move_home"
    assert served.house.conductor.state == "move_home"


def test_ready_is_told_once(served: Served) -> None:
    """When the devices are known the daemon is ready, once."""
    served.turn_until(lambda: True)
    served.turn_until(lambda: True)
    assert served.ready == [True]


def test_the_loop_ends_when_the_worker_has_gone(served: Served) -> None:
    """Asked to end, the loop quits the worker and then returns."""
    asked = iter([None, "SIGTERM"])
    served.mailbox.put(WorkerGone())
    served.loop.run(lambda: next(asked, "SIGTERM"))
    assert served.house.conductor.finished


def test_a_mailbox_keeps_the_order_and_wakes(served: Served) -> None:
    """Messages come out as they went in, however many."""
    mailbox = Mailbox()
    messages = [WorkerGone(str(n)) for n in range(10_000)]
    for message in messages:
        mailbox.put(message)
    assert mailbox.drain() == messages
    assert mailbox.drain() == []
    mailbox.close()
    mailbox.put(WorkerGone())
    assert served.ready == []
