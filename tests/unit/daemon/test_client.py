"""The client: answers matched by id, nothing that hangs, events without repeats."""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import zmq

from legato.daemon.client import Client, DaemonUnavailable, RpcError

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


def test_events_come_without_repeats_and_end_with_the_silence() -> None:
    """What is sent again for others is left out; a new boot begins anew."""
    context = zmq.Context()
    publisher = context.socket(zmq.XPUB)
    publisher.linger = 0
    port = publisher.bind_to_random_port("tcp://127.0.0.1")
    with Client(NOBODY, f"tcp://127.0.0.1:{port}") as client:
        for _ in range(7):
            assert publisher.recv().startswith(b"\x01")
        told = [("a", "state", 3), ("a", "contact", 2), ("a", "state", 3), ("a", "state", 4),
                ("b", "state", 1)]  # fmt: skip
        for boot, topic, seq in told:
            event = {"boot": boot, "seq": seq}
            publisher.send_multipart([topic.encode(), json.dumps(event).encode()])
        heard = [(e["boot"], topic, e["seq"]) for topic, e in client.events(0.2)]
    context.destroy(linger=0)
    assert heard == [told[0], told[1], told[3], told[4]]


def test_events_need_their_address() -> None:
    """A client without the events' endpoint says so."""
    with Client(NOBODY) as client, pytest.raises(ValueError, match="events"):
        next(client.events(0.1))
