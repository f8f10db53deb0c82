"""The desk: one answer for each request, late ones without blocking, junk without harm."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from legato.control.states import FAULT, IDLE, states
from legato.control.table import METHODS, ROLES, admit
from legato.daemon.gate import Moment
from legato.daemon.orders import DoReference
from legato.daemon.who import Who
from legato.wire.requests import REQUESTS
from tests.unit.daemon.bench import settings
from tests.unit.daemon.house import CAMERA_LOST, House

Maker = Callable[[], House]

STATES = states(settings().stations)


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    """Give a house whose devices are known."""
    made = House(tmp_path).known()
    yield made
    made.close()


def bring(house: House, state: str) -> None:
    """Bring the cell to a state by the ways that there are."""
    if state == IDLE:
        return
    session = house.begin("run")
    if state == FAULT:
        house.end(session, "fault", CAMERA_LOST)
        return
    for step in STATES[2:]:
        if house.conductor.state != state:
            house.want(session, step)


def test_the_wires_methods_are_the_tables() -> None:
    """Every method that can be asked has its row for every state, and no other."""
    assert set(REQUESTS) == set(METHODS)


@pytest.mark.parametrize("state", STATES)
def test_every_method_has_the_tables_answer(tmp_path: Path, state: str) -> None:
    """For each pair of state and method the daemon refuses exactly what the table refuses."""
    needed: dict[str, dict[str, Any]] = {
        "wait": {"session": "none"}, "session": {"session": "none"},
        "events_since": {"boot": "boot", "seq": 0}, "campaign": {"count": 1},
    }  # fmt: skip
    for method in METHODS:
        house = House(tmp_path / method).known()
        bring(house, state)
        assert house.conductor.state == state
        answer = house.ask(method, **needed.get(method, {}))
        name = answer["error"]["message"] if answer and "error" in answer else None
        no = admit(method, state)
        if no is not None:
            assert name == no.code, (method, state)
        elif method in ("wait", "session"):
            assert name == "invalid_params"
        else:
            # What the table admits may still lack something that no state tells of.
            assert name in (None, "precondition"), (method, state)
        house.close()


def test_wait_answers_when_the_session_ends(house: House) -> None:
    """The line is free meanwhile, and the answer has the outcome and the state after it."""
    session = house.begin("home")
    assert house.ask("wait", session=session, timeout_s=60) is None
    call = house.calls
    assert house.result("ping")["state"] == "move_home"
    house.end(session, "refused")
    assert house.answer(call) == {
        "jsonrpc": "2.0",
        "id": call,
        "result": {"session": session, "state": "idle", "outcome": "refused", "reason": "because"},
    }
    assert house.result("wait", session=session)["outcome"] == "refused"


def test_wait_answers_when_its_time_is_up(house: House) -> None:
    """A session that still runs has outcome null, at the end of the time and not before."""
    session = house.begin("home")
    assert house.result("wait", session=session, timeout_s=0)["outcome"] is None
    house.ask("wait", session=session, timeout_s=2.0)
    call = house.calls
    house.pass_time(1.9)
    assert house.answer(call) is None
    house.pass_time(0.2)
    answer = house.answer(call)
    assert answer is not None
    assert answer["result"]["outcome"] is None


def test_many_wait_for_one_session_but_not_without_end(house: House) -> None:
    """Each of many gets its answer; more than can be kept are told so."""
    session = house.begin("home")
    calls = []
    for _ in range(256):
        assert house.ask("wait", session=session) is None
        calls.append(house.calls)
    assert house.error("wait", session=session)[1] == "unavailable"
    house.end(session)
    assert all(house.answer(call) is not None for call in calls)


def test_unknown_sessions_are_told(house: House) -> None:
    """A session that is not there is invalid_params, also where its name is odd."""
    for odd in ("none", "../../etc", "20260301T100000Z-0000"):
        assert house.error("wait", session=odd)[1] == "invalid_params"
        assert house.error("session", session=odd)[1] == "invalid_params"


def test_sessions_are_listed_newest_first(house: House) -> None:
    """The list has what each was and how it ended."""
    first = house.begin("home")
    house.end(first)
    second = house.begin("capture")
    listed = house.result("sessions")["sessions"]
    assert [(s["id"], s["job"], s["outcome"]) for s in listed] == [
        (second, "capture", None),
        (first, "home", "done"),
    ]
    assert len(house.result("sessions", limit=1)["sessions"]) == 1


def test_an_old_session_is_found_on_disk(house: House, tmp_path: Path) -> None:
    """The outcome can be read at any time, also by the next daemon."""
    session = house.begin("home")
    house.end(session)
    later = House(tmp_path).known()
    assert later.result("session", session=session)["outcome"] == "done"
    assert later.result("wait", session=session)["outcome"] == "done"


def test_jobs_wait_until_the_devices_are_known(tmp_path: Path) -> None:
    """A job asked for while the devices are being opened begins afterwards; status answers."""
    house = House(tmp_path)
    assert house.result("status")["arm"]["connected"] is False
    assert house.ask("home") is None
    call = house.calls
    house.known()
    answer = house.answer(call)
    assert answer is not None
    assert answer["result"]["state"] == "move_home"
    house.close()


def test_devices_that_never_answer_keep_no_client(tmp_path: Path) -> None:
    """After its time a job that waited for the devices is refused as unavailable."""
    house = House(tmp_path)
    house.ask("home")
    house.pass_time(21.0)
    answer = house.answer(house.calls)
    assert answer is not None
    assert answer["error"]["message"] == "unavailable"


def test_reference_takes_the_start_pose_by_default(house: House) -> None:
    """What the operator leaves out is the configured start pose."""
    assert house.ask("reference") is None
    task = house.task()
    assert isinstance(task, DoReference)
    assert task.pose == settings().start
    assert house.error("home")[1] == "busy"


def test_reference_takes_a_pose_in_people_s_units(house: House) -> None:
    """Degrees on the wire, rad inside."""
    house.ask("reference", xyz_mm=[200, 10, 120], pitch_deg=-80, roll_deg=5)
    task = house.task()
    assert isinstance(task, DoReference)
    assert (task.pose.x, task.pose.y, task.pose.z) == (200.0, 10.0, 120.0)
    assert task.pose.pitch == pytest.approx(math.radians(-80))
    assert task.pose.roll == pytest.approx(math.radians(5))


def test_a_pose_out_of_reach_is_refused(house: House) -> None:
    """The arm cannot stand where it cannot reach."""
    assert house.error("reference", xyz_mm=[2000, 0, 0])[1] == "invalid_params"
    assert house.task() is None


def test_a_slow_reset_is_answered_and_its_late_success_changes_nothing(house: House) -> None:
    """Devices that take too long leave the fault latched."""
    house.result("estop")
    assert house.ask("reset") is None
    call = house.calls
    house.pass_time(21.0)
    answer = house.answer(call)
    assert answer is not None
    assert answer["error"]["message"] == "unavailable"
    house.end_task()
    assert house.conductor.state == "fault"


def test_describe_tells_all_a_client_needs(house: House) -> None:
    """Methods with schemas, states, the whole table, errors, causes, outcomes, version."""
    told = house.result("describe")
    assert set(told["methods"]) == set(METHODS)
    assert told["states"] == list(STATES)
    assert len(told["table"]) == len(STATES) * len(METHODS)
    assert told["errors"]["busy"] == -32003
    assert "following_error" in told["fault_causes"]
    assert told["outcomes"] == ["done", "stopped", "refused", "fault", "interrupted"]
    assert told["api"] == "1"


def test_events_can_be_replayed(house: House) -> None:
    """What a client missed comes again by number."""
    session = house.begin("home")
    house.end(session)
    told = house.result("events_since", boot="boot", seq=1)
    assert [e["seq"] for e in told["events"]] == list(range(2, told["seq"] + 1))
    assert told["complete"]
    assert told["events"][0]["topic"] == "session"


def test_junk_is_answered_and_counted(house: House) -> None:
    """No message raises, and status is as it was."""
    before = house.result("status")
    for body in (b"", b"\xff", b"[]", b"{}", b'{"jsonrpc":"2.0","id":1,"method":5}'):
        house.desk.receive([b"client", body], house.now)
    house.desk.receive([b"client"], house.now)
    house.desk.receive([b"client", b"a", b"b", b"c"], house.now)
    assert house.desk.junk == 7
    assert all("error" in body for _, body in house.replies[1:])
    assert house.result("status") == before


def test_a_notification_is_carried_out_without_an_answer(house: House) -> None:
    """JSON-RPC's notifications get neither result nor error."""
    for method in ("estop", "nonsense"):
        body = json.dumps({"jsonrpc": "2.0", "method": method}).encode()
        house.desk.receive([b"client", body], house.now)
    assert house.replies == []
    assert house.conductor.state == "fault"


def test_a_bug_in_a_request_is_answered_and_does_not_spread(house: House) -> None:
    """An internal error is told with its code; the next request is served."""

    def broken() -> dict[str, Any]:
        raise ZeroDivisionError("oops")

    house.conductor.standing.status = broken  # type: ignore[method-assign]
    assert house.error("status")[:2] == (-32603, "internal_error")
    assert house.result("ping")["boot"] == "boot"


def test_those_who_wait_are_answered_at_the_end(house: House) -> None:
    """The daemon leaves no request without an answer."""
    session = house.begin("home")
    house.ask("wait", session=session)
    call = house.calls
    house.desk.close()
    answer = house.answer(call)
    assert answer is not None
    assert answer["result"]["outcome"] is None


@pytest.mark.parametrize("role", [*ROLES, "none"])
def test_a_role_may_ask_for_its_methods_and_no_others(house: House, role: str) -> None:
    """What a role may not ask for is not authorised, in whatever state, and does nothing."""
    who = Who("somebody", role)
    for method in METHODS:
        if method in ROLES.get(role, ()):
            continue
        body = json.dumps({"jsonrpc": "2.0", "id": method, "method": method}).encode()
        house.desk.receive([b"client", body], house.now, who)
        (_, answer) = house.replies[-1]
        assert answer["id"] == method
        assert (answer["error"]["code"], answer["error"]["message"]) == (-32002, "not_authorised")
    assert house.conductor.state == "idle"
    assert house.result("sessions")["sessions"] == []


def test_a_job_that_a_stop_has_overtaken_does_not_begin(house: House) -> None:
    """Sent before a stop, handled after it: refused; sent after it, it begins."""
    gate = house.conductor.gate
    gate.ask("somebody", Moment(house.now, 0.0), estop=False)
    body = json.dumps({"jsonrpc": "2.0", "id": "old", "method": "home"}).encode()
    house.desk.receive([b"client", body], house.now, since=0)
    (_, answer) = house.replies[-1]
    assert (answer["id"], answer["error"]["message"]) == ("old", "expired")
    assert house.result("home")["state"] == "move_home"
