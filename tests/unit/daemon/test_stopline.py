"""The stop line: it acts whatever loop, driver or disk do, and confirms only what is true."""

import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from legato.hal.faults import Cause, DeviceError
from tests.unit.daemon.whole import Whole, whole


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Whole]:
    """Give a daemon on fakes in idle."""
    with whole(tmp_path) as made:
        yield made


def steps(cell: Whole) -> list[int]:
    """Return how the base was turned, motion by motion, as it reached the arm."""
    return [move.steps[0] for move in cell.arm.moves]


def blocked(cell: Whole) -> threading.Event:
    """Begin a job whose next motion lasts until the event is set; it is on its way on return."""
    release, begun = threading.Event(), threading.Event()

    def block() -> None:
        begun.set()
        assert release.wait(30.0)

    cell.before_step = block
    cell.do("home")
    assert begun.wait(20.0)
    return release


def test_an_estop_ends_motion_and_is_confirmed(cell: Whole) -> None:
    """Between motions it is confirmed at once; nothing more reaches the arm; fault latches."""
    cell.do("home")
    cell.until_moving()
    told = cell.do("estop", line="stop")
    count = len(cell.arm.moves)
    assert told["received"] <= told["commanded"] <= told["confirmed"]
    assert told["reason"] is None
    assert (told["method"], told["by"], told["state"]) == ("estop", "local", "fault")
    assert set(told["wall"]) == {"received", "commanded", "confirmed"}
    cell.until(lambda: cell.conductor.state == "fault")
    assert cell.do("status")["fault"]["cause"] == "estop"
    assert cell.error("home")["code"] == -32004
    assert len(cell.arm.moves) == count


def test_a_stop_retracts_and_no_more(cell: Whole) -> None:
    """The procedure is told once, retracts, and ends as stopped; who asked is in the record."""
    session = cell.do("home")["session"]
    cell.until_moving()
    told = cell.do("stop", line="stop")
    assert told["state"] == "stopping"
    assert told["confirmed"] is not None
    again = cell.do("stop", line="stop")
    assert again["confirmed"] is not None
    assert cell.do("wait", session=session)["outcome"] == "stopped"
    assert steps(cell)[-1] == 7
    assert steps(cell).count(7) == 1
    states = cell.store.read(session).of_kind("state")
    (stopping,) = [e["data"] for e in states if e["data"]["state"] == "stopping"]
    assert (stopping["cause"], stopping["by"]) == ("stop", "local")


@pytest.mark.parametrize("method", ["stop", "estop"])
def test_a_blocked_driver_call_delays_the_confirmation_alone(cell: Whole, method: str) -> None:
    """While a motion hangs the answer comes, unconfirmed; the confirmation follows the driver."""
    release = blocked(cell)
    told = cell.do(method, line="stop", timeout_s=0)
    assert told["commanded"] >= told["received"]
    assert (told["confirmed"], told["reason"]) == (
        None, "the motion on its way has not ended yet",
    )  # fmt: skip
    assert cell.do("ping", line="stop")["last"]["confirmed"] is None
    before = time.monotonic()
    cell.before_step = lambda: None
    release.set()
    cell.until(lambda: cell.do("ping", line="stop")["last"]["confirmed"] is not None)
    last = cell.do("ping", line="stop")["last"]
    assert last["confirmed"] >= before > last["commanded"]
    cell.until(lambda: cell.conductor.standing.sessions.current is None)
    assert steps(cell) == ([1] if method == "estop" else [1, 7])


def test_an_answer_waits_for_a_motion_that_ends_in_time(cell: Whole) -> None:
    """With time to wait the one answer is the confirmed one."""
    release = blocked(cell)
    call = cell.send("estop", line="stop", timeout_s=30)
    cell.until(lambda: cell.orders.gate.closed)
    release.set()
    answer = cell.answer(call, line="stop")
    assert answer["result"]["confirmed"] is not None
    assert steps(cell) == [1]


def test_a_motion_that_failed_confirms_nothing(cell: Whole) -> None:
    """Where the driver lost the arm, nobody says that it stands."""
    release, begun = threading.Event(), threading.Event()

    def lose() -> None:
        begun.set()
        assert release.wait(30.0)
        raise DeviceError(Cause.ARM_TIMEOUT, "no answer in 1.2 s", "look at the arm")

    cell.before_step = lose
    cell.do("home")
    assert begun.wait(20.0)
    call = cell.send("estop", line="stop", timeout_s=30)
    cell.until(lambda: cell.orders.gate.closed)
    release.set()
    told = cell.answer(call, line="stop")["result"]
    assert told["confirmed"] is None
    assert "no answer in 1.2 s" in told["reason"]


@pytest.mark.parametrize("method", ["stop", "estop"])
def test_a_busy_loop_holds_nothing_up(cell: Whole, method: str) -> None:
    """While the loop hangs in a write the stop is answered, confirmed, and heeded by the arm."""
    cell.do("home")
    cell.until_moving()
    hangs, release = threading.Event(), threading.Event()

    def hang(topic: str) -> None:
        if topic == "heartbeat":
            hangs.set()
            assert release.wait(30.0)

    cell.before_publish = hang
    assert hangs.wait(20.0)
    told = cell.do(method, line="stop", timeout_s=5)
    assert told["confirmed"] is not None
    if method == "stop":
        cell.until(lambda: steps(cell)[-1:] == [7] or cell.orders.gate.on_its_way() is None)
    count = len(cell.arm.moves)
    assert cell.conductor.state == "move_home"
    cell.before_publish = lambda _: None
    release.set()
    cell.until(lambda: cell.conductor.standing.sessions.current is None)
    assert steps(cell)[count:] in ([], [7])
    assert steps(cell).count(7) == (1 if method == "stop" else 0)
    assert cell.conductor.state == ("idle" if method == "stop" else "fault")


def test_a_job_sent_before_a_stop_does_not_begin_after_it(cell: Whole) -> None:
    """A job that waited in the queue of a busy loop is refused as expired; a new one begins."""
    hangs, release = threading.Event(), threading.Event()

    def hang(topic: str) -> None:
        if topic == "heartbeat":
            hangs.set()
            assert release.wait(30.0)

    cell.before_publish = hang
    assert hangs.wait(20.0)
    waiting = cell.send("home")
    cell.do("stop", line="stop")
    cell.before_publish = lambda _: None
    release.set()
    error = cell.answer(waiting)["error"]
    assert (error["code"], error["message"]) == (-32006, "expired")
    assert cell.arm.moves == []
    for _ in range(20):
        assert cell.do("stop", line="stop")["state"] == "idle"
        session = cell.do("home")["session"]
        cell.do("stop")
        assert cell.do("wait", session=session)["outcome"] == "stopped"


def test_every_state_has_its_stop(cell: Whole) -> None:
    """Idle, moving, paused, stopping and fault: each is answered and confirmed."""
    assert cell.do("stop", line="stop")["state"] == "idle"
    session = cell.do("home")["session"]
    cell.until_moving()
    cell.do("pause")
    cell.until(lambda: cell.conductor.state == "paused")
    told = cell.do("stop", line="stop")
    assert (told["state"], told["confirmed"]) == ("stopping", told["commanded"])
    assert cell.do("wait", session=session)["outcome"] == "stopped"
    assert steps(cell)[-1] == 7
    assert cell.do("estop", line="stop")["state"] == "fault"
    assert cell.do("stop", line="stop")["state"] == "fault"
    assert cell.do("estop", line="stop")["confirmed"] is not None
    assert cell.do("ping", line="stop")["closed"]


def test_reset_opens_the_gate_for_the_estops_before_it(cell: Whole) -> None:
    """After reset jobs move again; an estop that comes later closes the gate anew."""
    cell.do("estop", line="stop")
    cell.until(lambda: cell.conductor.state == "fault")
    assert cell.do("reset")["state"] == "idle"
    assert not cell.do("ping", line="stop")["closed"]
    cell.do("home")
    cell.until_moving()
    cell.do("estop", line="stop")
    cell.until(lambda: cell.conductor.standing.sessions.current is None)
    assert cell.conductor.state == "fault"


def test_the_session_of_an_estop_has_its_outcome(cell: Whole) -> None:
    """However quick the worker is, the record says fault, estop, and who asked."""
    for _ in range(10):
        session = cell.do("home")["session"]
        cell.until_moving()
        cell.do("estop", line="stop")
        told = cell.do("wait", session=session)
        assert (told["outcome"], told["state"]) == ("fault", "fault")
        (fault,) = cell.store.read(session).of_kind("fault")
        assert (fault["data"]["cause"], fault["data"]["evidence"]["by"]) == ("estop", "local")
        cell.do("reset")


def test_only_three_methods_and_no_junk_disturb_it(cell: Whole) -> None:
    """All else has an error of one line; odd frames are answered or dropped."""
    error = cell.error("run", line="stop")
    assert error["code"] == -32601
    assert "stop line" in error["data"]["hint"]
    assert cell.error("stop", line="stop", lease="mine")["code"] == -32602
    line = cell._lines["stop"]
    for frames in ([b""], [b"", b"", b""], [b"\xff" * 99], [b"["] * 9, [b"{}"]):
        line.send_multipart(frames)
        assert "error" in json.loads(line.recv_multipart()[-1])
    assert cell.stopline.junk == 5
    assert cell.do("ping", line="stop")["boot"] == "boot"


def test_status_tells_the_latencies(cell: Whole) -> None:
    """Each stop is counted from received to commanded, and to confirmed."""
    assert cell.do("status")["stop"]["commanded"]["count"] == 0
    for _ in range(3):
        cell.do("stop", line="stop")
    told: dict[str, Any] = cell.do("status")["stop"]
    for name in ("commanded", "confirmed"):
        assert told[name]["count"] == sum(told[name]["counts"]) == 3
        assert len(told[name]["counts"]) == len(told[name]["at_most_ms"]) + 1
        assert 0 < told[name]["max_ms"] < 1000


def test_each_stop_is_in_the_log(cell: Whole) -> None:
    """A person finds in the morning who stopped what, and when it was confirmed."""
    cell.do("estop", line="stop")
    cell.until(lambda: "stop_line" in [event for event, _ in cell.log.lines])
    (line,) = [fields for event, fields in cell.log.lines if event == "stop_line"]
    assert (line["method"], line["by"]) == ("estop", "local")
    assert line["confirmed"] >= line["received"]
