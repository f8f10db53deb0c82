"""The follower, where the daemon is not to be had: what pages are told of the stop line."""

import threading
from typing import Any

from legato.web.feed import Feed
from tests.unit.daemon.test_client import NOBODY, daemon, echo

Lost = tuple[str, str, bool | None]


def lost(stop: str) -> list[Lost]:
    """Return what a feed posts first when only the stop line may answer."""
    told: list[Lost] = []
    enough = threading.Event()

    def post(kind: str, what: Any) -> None:
        assert kind == "lost"
        told.append(what)
        if len(told) >= 2:
            enough.set()

    lines = {"requests": NOBODY, "events": NOBODY, "stop": stop}
    feed = Feed(lines, None, post, answer_s=0.05, stop_s=2.0 if stop != NOBODY else 0.05)
    feed.start()
    assert enough.wait(20.0)
    feed.end()
    return told[:2]


def test_a_stop_line_that_answers_is_told_apart() -> None:
    """A daemon whose loop hangs can still be stopped; it is said at once that it is lost."""
    with daemon(echo) as stop:
        found = lost(stop)
    assert [(hint, stops) for _, hint, stops in found] == [
        ("see that `legato serve` runs", None),
        ("see that `legato serve` runs", True),
    ]


def test_where_no_stop_arrives_it_is_told() -> None:
    """A daemon that is dead has no stop line either."""
    assert [stops for *_, stops in lost(NOBODY)] == [None, False]
