"""Events: numbers without a gap, the latest of each topic, replay."""

import json
from typing import Any

import pytest

from legato.daemon.events import Events
from legato.wire.jsonrpc import encode


def made(kept: int = 100) -> tuple[Events, list[tuple[str, dict[str, Any]]]]:
    """Return events with the list of what they publish."""
    published: list[tuple[str, dict[str, Any]]] = []
    events = Events("b", lambda: 1.5, lambda t, b: published.append((t, json.loads(b))), kept)
    return events, published


def replayed(events: Events, boot: str, seq: int, limit: int = 100) -> dict[str, Any]:
    """Return a replay as a client decodes it."""
    found: dict[str, Any] = json.loads(encode(events.since(boot, seq, limit)))
    return found


def test_every_event_has_boot_number_time_and_session() -> None:
    """Numbers run on over all topics, and data cannot overwrite them."""
    events, published = made()
    events.emit("state", None, {"state": "idle", "seq": 99})
    events.emit("contact", "s", {"contact_mm": 0.25})
    assert published == [
        ("state", {"topic": "state", "boot": "b", "seq": 1, "t": 1.5, "session": None,
                   "state": "idle"}),
        ("contact", {"topic": "contact", "boot": "b", "seq": 2, "t": 1.5, "session": "s",
                     "contact_mm": 0.25}),
    ]  # fmt: skip


def test_only_the_wires_topics_exist() -> None:
    """A misspelt topic is a bug that shows at once."""
    with pytest.raises(ValueError, match="presses"):
        made()[0].emit("presses", None, {})


def test_the_latest_of_each_topic_is_kept_by_prefix() -> None:
    """A subscription gets the last event of each topic it takes in, the state first."""
    events, _ = made()
    for topic in ("heartbeat", "state", "state", "session"):
        events.emit(topic, None, {})
    seqs = [(topic, json.loads(body)["seq"]) for topic, body in events.latest("")]
    assert seqs == [("state", 3), ("heartbeat", 1), ("session", 4)]
    assert [t for t, _ in events.latest("s")] == ["state", "session"]
    assert events.latest("progress") == []


def test_replay_gives_what_was_missed() -> None:
    """Everything after a number comes again in its order, in pieces where it is much."""
    events, published = made()
    for _ in range(5):
        events.emit("progress", "s", {})
    whole = replayed(events, "b", 2)
    assert whole["events"] == [e for _, e in published[2:]]
    assert (whole["complete"], whole["more"], whole["seq"]) == (True, False, 5)
    piece = replayed(events, "b", 0, limit=2)
    assert [e["seq"] for e in piece["events"]] == [1, 2]
    assert piece["more"]
    assert replayed(events, "b", 5)["events"] == []


def test_replay_says_when_something_is_lost() -> None:
    """Events that are no longer kept, and another boot's, are told as incomplete."""
    events, _ = made(kept=3)
    assert replayed(events, "b", 0)["complete"]
    for _ in range(5):
        events.emit("progress", "s", {})
    assert [e["seq"] for e in replayed(events, "b", 2)["events"]] == [3, 4, 5]
    assert replayed(events, "b", 2)["complete"]
    assert not replayed(events, "b", 1)["complete"]
    other = replayed(events, "earlier", 4)
    assert [e["seq"] for e in other["events"]] == [3, 4, 5]
    assert not other["complete"]
