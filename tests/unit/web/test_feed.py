"""The follower, where the daemon is not to be had: what pages are told of the stop line."""

import threading
from typing import Any

import zmq

from legato.daemon.keys import Keys
from legato.web.feed import Feed
from tests.unit.daemon.test_client import NOBODY, daemon, echo

Lost = tuple[str, str, bool | None]


def lost(lines: dict[str, str], keys: Keys | None = None, stop_s: float = 2.0) -> list[Lost]:
    """Return what a feed posts first when it cannot follow."""
    told: list[Lost] = []
    enough = threading.Event()

    def post(kind: str, what: Any) -> None:
        assert kind == "lost"
        told.append(what)
        if len(told) >= 2:
            enough.set()

    feed = Feed(lines, keys, post, answer_s=0.05 if keys is None else 2.0, stop_s=stop_s)
    feed.start()
    assert enough.wait(20.0)
    feed.end()
    return told[:2]


def test_a_stop_line_that_answers_is_told_apart() -> None:
    """A daemon whose loop hangs can still be stopped; it is said at once that it is lost."""
    with daemon(echo) as stop:
        found = lost({"requests": NOBODY, "events": NOBODY, "stop": stop})
    assert [(hint, stops) for _, hint, stops in found] == [
        ("see that `legato serve` runs", None),
        ("see that `legato serve` runs", True),
    ]


def test_where_no_stop_arrives_it_is_told() -> None:
    """A daemon that is dead has no stop line either."""
    nobody = dict.fromkeys(("requests", "events", "stop"), NOBODY)
    assert [stops for *_, stops in lost(nobody, stop_s=0.05)] == [None, False]


def test_where_the_key_is_refused_no_stop_arrives() -> None:
    """A refusal of the key is no answer of the stop line: what it lets nobody ask, it does not."""
    (public, secret), (server, _) = zmq.curve_keypair(), zmq.curve_keypair()
    with daemon(echo) as address:  # which does not encrypt
        lines = dict.fromkeys(("requests", "events", "stop"), address)
        found = lost(lines, Keys(public, secret, server))
    assert [stops for *_, stops in found] == [None, False]
    assert all("key refused" in reason for reason, *_ in found)
