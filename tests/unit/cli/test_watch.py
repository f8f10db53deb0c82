"""The live view: what it knows, what it draws, and that it outlives the daemon."""

import io
import re

import pytest
from rich.console import Console

from legato.cli.live import STALE_S, Live
from legato.cli.screen import fault_rows, screen
from tests.unit.cli.watched import ARM, seen, status


def drawn(live: Live, now: float, width: int = 120, height: int = 40) -> str:
    """Return the screen as text."""
    console = Console(width=width, height=height, file=io.StringIO())
    with console.capture() as held:
        console.print(screen(live, now, width, height), height=height)
    return held.get()


def follow(live: Live) -> None:
    """Let a session begin, touch twice at 7 mm, and go on to 67 mm."""
    live.take("session", {"boot": "b1", "id": "s1", "job": "run", "outcome": None}, 11.0)
    live.take("state", {"boot": "b1", "state": "massage_7", "session": "s1"}, 12.0)
    for height in (-0.2, -0.34):
        contact = {"boot": "b1", "station_mm": 7.0, "contact_mm": height, "session": "s1"}
        live.take("contact", contact, 13.0)
    told = {"boot": "b1", "arm": ARM | {"contact": True}, "why": "press", "station_mm": 67.0}
    live.take("telemetry", told, 13.5)
    said = {"boot": "b1", "text": "press 1 at 67 mm", "done": 4, "total": 12}
    live.take("progress", said, 13.6)
    live.take("state", {"boot": "b1", "state": "massage_67", "session": "s1"}, 14.0)


def test_states_add_up_and_the_present_one_is_lit() -> None:
    """How long each state lasted is told, the present one stands out in words too."""
    live = seen()
    follow(live)
    assert live.stays == {"idle": 2.0, "massage_7": 2.0}
    page = drawn(live, 15.0)
    assert "> massage_67" in page
    assert "* massage_7 " in page
    assert "SIMULATED" in page
    assert "press at 67 mm" in page
    assert "4/12" in page
    assert "YES" in page


def test_contacts_stand_by_station_with_the_last_one() -> None:
    """The last contact is a figure and a mark on the scale; those before it are marks."""
    live = seen()
    follow(live)
    page = drawn(live, 15.0)
    (line,) = [row for row in page.splitlines() if " 7 mm " in row and "@" in row]
    assert "-0.340" in line
    assert line.count("o") == 1
    assert line.index("@") < line.index("|", line.index("@"))


def test_contacts_of_another_session_are_not_this_ones() -> None:
    """A new session begins with none, and the last one of an old session is left out."""
    live = seen()
    follow(live)
    live.take("session", {"boot": "b1", "id": "s2", "job": "run", "outcome": None}, 20.0)
    old = {"boot": "b1", "station_mm": 7.0, "contact_mm": 1.0, "session": "s1"}
    live.take("contact", old, 20.1)
    assert (live.session, live.contacts, live.stays) == ("s2", {}, {})
    assert "none in this session" in drawn(live, 21.0)


def test_silence_is_stale_and_no_answer_is_lost() -> None:
    """Both are said in words, with what was last known; what comes back is called so."""
    live = seen()
    assert live.link(10.0 + STALE_S) == "live"
    assert live.link(10.1 + STALE_S) == "stale"
    assert "STALE: nothing heard for 5 s" in drawn(live, 15.0)
    live.lose(16.0)
    live.lose(17.0)
    page = drawn(live, 20.0)
    assert "CONNECTION LOST 4 s" in page
    assert "last known: idle" in page
    live.answered(status(), 21.0)
    assert live.link(21.0) == "live"
    assert [said.text for said in live.said if said.topic == "link"] == [
        "the daemon does not answer; trying again", "the daemon answers again",
    ]  # fmt: skip


def test_a_daemon_that_began_anew_leaves_nothing_of_the_old_one() -> None:
    """Contacts, stays and session are gone; events of the old boot are not taken."""
    live = seen()
    follow(live)
    live.answered(status("fault", "b2", fault={"cause": "interrupted", "text": "t"}), 30.0)
    assert (live.contacts, live.stays, live.session, live.state) == ({}, {}, None, "fault")
    live.take("state", {"boot": "b1", "state": "massage_7"}, 31.0)
    assert live.state == "fault"


def test_a_fault_is_shown_with_what_to_do_until_it_is_left() -> None:
    """Cause, text and hint stand under the banner, at any width; reset takes them away."""
    live = seen()
    told = {
        "boot": "b1",
        "cause": "arm_lost",
        "text": "no answer from the arm " * 4,
        "hint": "plug",
    }
    live.take("fault", told, 12.0)
    live.take("state", {"boot": "b1", "state": "fault"}, 12.0)
    for width in (60, 80, 120):
        page = drawn(live, 13.0, width)
        assert "FAULT arm_lost" in page
        assert "what to do: plug" in page
        assert "legato reset" in page
    assert fault_rows(told, 60) > fault_rows(told, 200)
    live.take("state", {"boot": "b1", "state": "idle"}, 14.0)
    assert "FAULT" not in drawn(live, 15.0)


@pytest.mark.parametrize("width", [60, 80, 120, 200])
def test_a_long_event_wraps_its_own_text_and_nothing_else(width: int) -> None:
    """Time of day and topic stand whole beside a text that no terminal holds in one line."""
    live = seen()
    long = "the switch closed in the descent, 9.75 mm above the surface " * 5
    live.take("fault", {"boot": "b1", "cause": "contact_early", "text": long}, 12.0)
    live.take("contact", {"boot": "b1", "station_mm": 7.0, "contact_mm": -0.2}, 12.5)
    rows = [line for line in drawn(live, 13.0, width, 40).splitlines()
            if re.match(r"\W+\d\d:\d\d:\d\d ", line)]  # fmt: skip
    assert [row.split()[2] for row in rows] == ["contact", "fault"]
    assert "contact_early: the switch closed" in rows[1]
    assert max(map(len, drawn(live, 13.0, width).splitlines())) <= width


@pytest.mark.parametrize(("width", "height"), [(60, 20), (80, 24), (120, 24), (200, 50)])
def test_the_arm_and_some_events_are_there_at_any_usual_size(width: int, height: int) -> None:
    """Small terminals leave out frames and figures, and never the arm, the contacts, the events."""
    live = seen()
    follow(live)
    page = drawn(live, 15.0, width, height)
    for part in ("massage_67", "connected, referenced", "press at 67 mm", "-0.340", "4/12",
                 "last events", "massage_67 "):  # fmt: skip
        assert part in page
    told = {"boot": "b1", "cause": "arm_lost", "text": "no answer " * 12, "hint": "plug it in"}
    live.take("fault", told, 15.0)
    live.take("state", {"boot": "b1", "state": "fault"}, 15.0)
    page = drawn(live, 16.0, width, height)
    for part in ("FAULT arm_lost", "plug it in", "legato reset", "connected, referenced",
                 "arm_lost: no answer"):  # fmt: skip
        assert part in page


def beat(live: Live, t: float, uptime: float, now: float) -> None:
    """Let a heartbeat come."""
    event = {"boot": "b1", "state": live.state, "t": t, "uptime_s": uptime}
    live.take("heartbeat", event, now)


def test_a_clock_of_the_cell_that_runs_faster_is_told_and_converted() -> None:
    """Ages are in the wall's seconds, and not told before the pace is known."""
    live = seen()
    live.status["camera"]["age_s"] = 60.0
    beat(live, 1000.0, 50.0, 10.0)
    assert live.pace is None
    assert "picture" not in drawn(live, 10.5)
    beat(live, 1020.0, 51.0, 11.0)
    assert live.pace == pytest.approx(20.0)
    page = drawn(live, 11.5)
    assert "picture 3 s old" in page
    assert "SIMULATED, clock x20" in page
    assert "state, wall seconds" in page


def test_a_clock_of_the_cell_that_is_the_walls_needs_no_word() -> None:
    """At the same pace nothing is said of clocks."""
    live = seen()
    for second in range(3):
        beat(live, 1000.0 + second, 50.0 + second, 10.0 + second)
    assert live.pace == pytest.approx(1.0)
    page = drawn(live, 12.5)
    assert "clock" not in page
    assert "wall seconds" not in page


def test_what_was_sent_again_keeps_its_own_time_of_day() -> None:
    """The latest of each topic, sent to a new subscriber, stands at the time it happened."""
    live = seen()
    live.take("session", {"boot": "b1", "t": 400.0, "id": "s0", "outcome": "done"}, 10.0)
    live.take("state", {"boot": "b1", "t": 1015.0, "state": "capture"}, 10.8)
    old, new = live.said
    assert live.happened_at(old) == 10.0  # nothing better is known yet
    beat(live, 1000.0, 50.0, 10.0)
    beat(live, 1020.0, 51.0, 11.0)
    assert live.happened_at(old) == pytest.approx(11.0 - 620.0 / 20.0)
    assert live.happened_at(new) == pytest.approx(10.75)
    live.answered(status(boot="b2"), 30.0)
    assert live.pace is None


def test_each_station_has_its_own_band() -> None:
    """What is predicted, and where it fits what is accepted, are drawn as status tells them."""
    live = seen()
    follow(live)
    live.status["calibration"]["stations"] = [
        {"station_mm": 7.0, "sigma_mm": 0.1, "expected_mm": 0.2, "accepted_mm": 0.4},
        {"station_mm": 67.0, "sigma_mm": 0.05, "expected_mm": 0.1, "accepted_mm": 0.4},
    ]
    live.take("contact", {"boot": "b1", "station_mm": 67.0, "contact_mm": 0.3}, 14.5)
    page = drawn(live, 15.0)
    assert "..[.@..o====|=====....].." in page
    assert "==|==" in next(row for row in page.splitlines() if " 67 mm " in row and "@" in row)
    assert "= predicted, \N{PLUS-MINUS SIGN} 2 sigma; [ ] accepted" in page


@pytest.mark.parametrize(("width", "height"), [(20, 5), (60, 12), (80, 24), (250, 80)])
def test_it_draws_at_any_size_and_before_anything_is_known(width: int, height: int) -> None:
    """No line is wider than the terminal, nothing is more than it is high."""
    bare = Live("tcp://127.0.0.1:5760")
    known = seen()
    follow(known)
    for live in (bare, known):
        lines = drawn(live, 15.0, width, height).splitlines()
        assert len(lines) <= height
        assert max(map(len, lines)) <= width


def test_a_job_that_has_ended_is_no_progress_of_a_later_fault() -> None:
    """An emergency stop after a whole job shows no strokes; a fault in a job shows how far."""
    live = seen()
    follow(live)
    live.take("state", {"boot": "b1", "state": "fault"}, 15.0)
    live.take("session", {"boot": "b1", "id": "s1", "job": "run", "outcome": "fault"}, 15.0)
    assert live.progress["done"] == 4
    live.take("state", {"boot": "b1", "state": "idle"}, 15.5)
    live.take("fault", {"boot": "b1", "cause": "estop", "text": "asked for"}, 16.0)
    live.take("state", {"boot": "b1", "state": "fault"}, 16.0)
    assert live.progress == {}


@pytest.mark.parametrize(("width", "height"), [(60, 20), (80, 24), (120, 40)])
def test_a_dead_daemon_leaves_old_news_that_says_so(width: int, height: int) -> None:
    """Panels tell when they were true, a stay counts no further, no reset is offered."""
    live = seen()
    told = {"boot": "b1", "cause": "arm_lost", "text": "no answer", "hint": "plug it in"}
    live.take("fault", told, 12.0)
    live.take("state", {"boot": "b1", "state": "fault"}, 12.0)
    live.take("heartbeat", {"boot": "b1", "state": "fault", "t": 1.0, "uptime_s": 1.0}, 14.0)
    live.lose(16.0)
    page = drawn(live, 120.0, width, height)
    assert "last known: fault" in page
    assert "as last heard" in page
    assert "hardware stop" in page
    assert "legato reset" not in page
    assert live.upto(120.0) == 14.0
    if width == 120:
        assert re.search(r"> fault +2\.0 s", page)
    live.answered(status("fault", fault=told), 121.0)
    page = drawn(live, 121.5, width, height)
    assert "as last heard" not in page
    assert "legato reset" in page


def test_the_head_says_which_device_is_simulated() -> None:
    """A real arm beside a simulated camera is no simulated cell."""
    live = seen()
    live.status["simulated_devices"] = ["camera"]
    assert " SIMULATED CAMERA " in drawn(live, 10.5)
