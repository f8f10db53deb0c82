"""The client: answers matched by id, nothing that hangs, events without repeats."""

import json
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zmq
from hypothesis import given
from hypothesis import strategies as st

from legato.daemon.client import Client, DaemonUnavailable, RpcError
from legato.daemon.sequence import Sequence

Behave = Callable[["zmq.Socket[bytes]", list[bytes], dict[str, Any]], None]
NOBODY = "tcp://127.0.0.1:9"  # discard: nothing listens there


@contextmanager
def daemon(behave: Behave) -> Iterator[str]:
    """Give the address of a ROUTER that treats each request as told; it ends with this."""
    context = zmq.Context()
    router = context.socket(zmq.ROUTER)
    router.linger = 0
    port = router.bind_to_random_port("tcp://127.0.0.1")
    ended = threading.Event()

    def serve() -> None:
        while not ended.is_set():
            if router.poll(10):
                *route, body = router.recv_multipart()
                behave(router, route, json.loads(body))

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield f"tcp://127.0.0.1:{port}"
    finally:
        ended.set()
        thread.join()
        context.destroy(linger=0)


def say(router: "zmq.Socket[bytes]", route: list[bytes], call_id: object, result: object) -> None:
    """Send a result."""
    answer = {"jsonrpc": "2.0", "id": call_id, "result": result}
    router.send_multipart([*route, json.dumps(answer).encode()])


def echo(router: "zmq.Socket[bytes]", route: list[bytes], call: dict[str, Any]) -> None:
    """Answer each call with what was called."""
    say(router, route, call["id"], [call["method"], call["params"]])


def test_a_call_has_its_result() -> None:
    """Method and parameters arrive, the result comes back."""
    with daemon(echo) as address, Client(address) as client:
        assert client.call("wait", session="s", timeout_s=1) == [
            "wait", {"session": "s", "timeout_s": 1},
        ]  # fmt: skip


def test_nobody_there_is_told_and_not_waited_for() -> None:
    """Without a daemon the call fails; the next one tries anew."""
    with Client(NOBODY, timeout_s=0.05) as client:
        for _ in range(2):
            with pytest.raises(DaemonUnavailable, match=r"127\.0\.0\.1:9"):
                client.call("status")


def test_a_request_that_is_too_long_is_not_sent() -> None:
    """It is refused here, with the limit, whether a daemon is there or not."""
    with Client(NOBODY) as client, pytest.raises(RpcError, match="at most 65536") as caught:
        client.call("session", session="x" * 70_000)
    assert caught.value.message == "invalid_request"
    assert caught.value.data["hint"]


def test_an_answer_that_comes_too_late_is_not_the_next_one() -> None:
    """After a time-out the late answer is thrown away with its socket."""
    late: list[tuple[list[bytes], object]] = []

    def slow(router: "zmq.Socket[bytes]", route: list[bytes], call: dict[str, Any]) -> None:
        if call["method"] == "first":
            late.append((route, call["id"]))
            return
        say(router, *late[0], "late")
        say(router, route, call["id"], "right")

    with daemon(slow) as address, Client(address, timeout_s=0.1) as client:
        with pytest.raises(DaemonUnavailable):
            client.call("first")
        assert client.call("second") == "right"


def test_answers_to_others_are_left_aside() -> None:
    """Only the answer with the call's id counts; what is no JSON does no harm."""

    def confused(router: "zmq.Socket[bytes]", route: list[bytes], call: dict[str, Any]) -> None:
        router.send_multipart([*route, b"\xff"])
        router.send_multipart([*route, b"[]"])
        say(router, route, "another", "wrong")
        say(router, route, call["id"], "right")

    with daemon(confused) as address, Client(address) as client:
        assert client.call("status") == "right"


def test_a_refusal_is_an_error_with_all_its_data() -> None:
    """Code, name, reason, state and hint reach the caller."""

    def refuse(router: "zmq.Socket[bytes]", route: list[bytes], call: dict[str, Any]) -> None:
        data = {"reason": "in capture", "state": "capture", "hint": "wait"}
        error = {"code": -32003, "message": "busy", "data": data}
        answer = {"jsonrpc": "2.0", "id": call["id"], "error": error}
        router.send_multipart([*route, json.dumps(answer).encode()])

    with (
        daemon(refuse) as address,
        Client(address) as client,
        pytest.raises(RpcError, match="in capture") as caught,
    ):
        client.call("run")
    assert (caught.value.code, caught.value.message) == (-32003, "busy")
    assert caught.value.data["hint"] == "wait"


def test_a_daemon_that_dies_keeps_no_caller(tmp_path: Path) -> None:
    """A call that is under way fails as soon as the connection is lost; the next finds another."""
    endpoint = f"ipc://{tmp_path}/line"
    context = zmq.Context()
    router = context.socket(zmq.ROUTER)
    router.linger = 0
    router.bind(endpoint)
    with Client(endpoint, timeout_s=30.0) as client, ThreadPoolExecutor(1) as pool:
        call = pool.submit(client.call, "status")
        assert router.poll(5000)
        router.close()
        with pytest.raises(DaemonUnavailable, match="gone"):
            call.result(10.0)
        again = context.socket(zmq.ROUTER)
        again.linger = 0
        again.bind(endpoint)
        call = pool.submit(client.call, "status")
        *route, body = again.recv_multipart()
        say(again, route, json.loads(body)["id"], "alive")
        assert call.result(10.0) == "alive"
        again.close()
    context.term()


def test_events_come_once_and_what_was_missed_comes_too(tmp_path: Path) -> None:
    """The latest of each topic first, then all events in order, gaps filled, over a restart."""
    context = zmq.Context()
    publisher = context.socket(zmq.XPUB)
    publisher.linger = 0
    publisher.bind(f"ipc://{tmp_path}/events")
    kept = {"a": 7}  # the daemon's own numbers, by boot

    def replay(router: "zmq.Socket[bytes]", route: list[bytes], call: dict[str, Any]) -> None:
        assert call["method"] == "events_since"
        ((boot, last),) = kept.items()
        first = call["params"]["seq"] + 1 if call["params"]["boot"] == boot else 1
        found = [{"boot": boot, "seq": n, "topic": "progress"} for n in range(first, last + 1)]
        say(router, route, call["id"], {"boot": boot, "seq": last, "events": found[:2]})

    def publish(boot: str, topic: str, seq: int) -> None:
        event = {"boot": boot, "seq": seq, "topic": topic}
        publisher.send_multipart([topic.encode(), json.dumps(event).encode()])

    with daemon(replay) as address, Client(address, f"ipc://{tmp_path}/events") as client:
        for _ in range(7):
            assert publisher.recv().startswith(b"\x01")
        for topic, seq in (("state", 5), ("contact", 3), ("state", 5)):
            publish("a", topic, seq)
        heard = list(client.events(0.2))
        assert [(t, e["seq"]) for t, e in heard] == [("state", 5), ("contact", 3)]
        kept["a"] = 14
        for topic, seq in (("state", 8), ("contact", 13), ("progress", 12), ("state", 14)):
            publish("a", topic, seq)
        heard = list(client.events(0.2))
        assert [e["seq"] for _, e in heard] == list(range(8, 15))
        assert [t for t, e in heard if e["seq"] in (8, 9, 13, 14)] == [
            "state", "progress", "contact", "state",
        ]  # fmt: skip
        kept.clear()
        kept["b"] = 4
        publish("b", "heartbeat", 4)
        heard = list(client.events(0.2))
        assert [(e["boot"], e["seq"]) for _, e in heard] == [("b", n) for n in range(1, 5)]
        assert client.lost == 0
    context.destroy(linger=0)


def test_what_no_replay_has_is_counted_as_lost() -> None:
    """Where the daemon has forgotten events, or cannot be asked, the client says how many."""
    answers: list[dict[str, Any] | None] = [
        {"boot": "a", "seq": 1, "events": []},
        {"boot": "a", "seq": 9, "events": [{"topic": "state", "seq": n} for n in (6, 7, 8, 9)]},
        None,
    ]
    sequence = Sequence(lambda boot, seq: answers.pop(0))  # noqa: ARG005 # the replay's signature
    heard = [e["seq"] for n in (1, 9, 12) for _, e in sequence.take("state", event("a", n))]
    assert heard == [1, 6, 7, 8, 9, 12]
    assert sequence.lost == 4 + 2


@given(data=st.data())
def test_every_event_once_whatever_is_lost_and_repeated(data: st.DataObject) -> None:
    """From any part of the events, with repeats, a client that can replay has all of them."""
    total = data.draw(st.integers(1, 30))
    arriving = sorted(data.draw(st.sets(st.integers(1, total), min_size=1)))
    topics = [data.draw(st.sampled_from(["state", "contact"])) for _ in range(total + 1)]
    limit = data.draw(st.integers(1, 5))
    now = 0

    def replay(boot: str, seq: int) -> dict[str, Any]:
        found = [event(boot, n) | {"topic": topics[n]} for n in range(seq + 1, now + 1)]
        return {"boot": boot, "seq": now, "events": found[:limit]}

    sequence, heard = Sequence(replay), list[int]()
    sequence.begin("a", 0)
    for seq in arriving:
        now = seq
        for _ in range(data.draw(st.integers(1, 2))):
            heard += [e["seq"] for _, e in sequence.take(topics[seq], event("a", seq))]
    assert heard == list(range(1, arriving[-1] + 1))
    assert sequence.lost == 0


def event(boot: str, seq: int) -> dict[str, Any]:
    """Return an event's head."""
    return {"boot": boot, "seq": seq}


def test_events_need_their_address() -> None:
    """A client without the events' endpoint says so."""
    with Client(NOBODY) as client, pytest.raises(ValueError, match="events"):
        next(client.events(0.1))
