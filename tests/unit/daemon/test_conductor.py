"""The conductor: every accepted job has one outcome, faults latch, time-outs end, stops win."""

from dataclasses import replace

import pytest

from legato.control.effects import StopRequested
from legato.control.memory import Memory
from legato.control.states import deadline
from legato.daemon.messages import Happened, Moved, View
from legato.daemon.orders import Dropped
from tests.unit.daemon.house import CAMERA_LOST, GOOD, House, Maker, session_json


def test_a_job_goes_through_its_states_to_done(house: House) -> None:
    """States are published in order, recorded, and the session has its outcome."""
    session = house.begin("run")
    assert house.conductor.state == "capture"
    for state in ("capture", "calibrate", "verify", "move_home", "massage_7", "move_home"):
        assert house.want(session, state)
    house.end(session)
    assert house.states() == [
        "idle", "capture", "calibrate", "verify", "move_home", "massage_7", "move_home", "idle",
    ]  # fmt: skip
    assert house.result("session", session=session)["outcome"] == "done"
    assert session_json(house, session)["outcome"] == "done"
    recorded = [e["data"].get("state") for e in house.store.read(session).of_kind("state")]
    assert recorded == house.states()[1:]


def test_a_fault_is_latched_until_reset(house: House) -> None:
    """Nothing but reset leaves fault, and reset only when the devices answer."""
    session = house.begin("run")
    house.end(session, "fault", CAMERA_LOST)
    fault = house.result("status")["fault"]
    assert (fault["cause"], fault["text"], fault["session"]) == (
        "camera_lost", "no picture", session,
    )  # fmt: skip
    for method in ("run", "home", "reference", "stop", "pause", "resume"):
        assert house.error(method)[1] == "in_fault"
    assert house.ask("reset") is None
    call = house.calls
    house.end_task(("no picture", "plug it in"))
    answer = house.answer(call)
    assert answer is not None
    assert answer["error"]["message"] == "unavailable"
    assert house.conductor.state == "fault"
    assert house.ask("reset") is None
    call = house.calls
    house.end_task()
    answer = house.answer(call)
    assert answer is not None
    assert answer["result"]["state"] == "idle"
    assert house.result("status")["fault"] is None
    assert house.states()[-2:] == ["fault", "idle"]


@pytest.mark.parametrize("state", ["capture", "calibrate", "verify", "move_home", "massage_7",
                                   "stopping"])  # fmt: skip
def test_every_transient_state_has_a_deadline(house: House, state: str) -> None:
    """A state that does not end is fault `deadline`; a worker that is stuck keeps no session.

    Where the arm may be at the leg it is given the time of a stop to come off it first.
    """
    session = house.begin("run")
    for step in ("calibrate", "verify", "move_home", "massage_7", "stopping"):
        if house.conductor.state == state:
            break
        house.want(session, step)
    limit = deadline(state)
    assert limit is not None
    house.pass_time(limit - 0.1)
    assert house.conductor.state == state
    house.pass_time(0.2)
    if state in ("move_home", "massage_7"):
        assert house.conductor.state == "stopping"
        with pytest.raises(StopRequested):
            house.orders.look()
        house.pass_time((deadline("stopping") or 0.0) + 0.1)
    assert house.result("status")["fault"]["cause"] == "deadline"
    assert house.result("session", session=session)["outcome"] is None
    house.pass_time(6.0)
    assert house.result("session", session=session)["outcome"] == "fault"
    assert house.error("reset")[1] == "unavailable"
    house.end(session, None)
    house.ask("reset")
    house.end_task()
    assert house.conductor.state == "idle"


def test_idle_paused_and_fault_last_for_ever(house: House) -> None:
    """Waiting for a person has no deadline."""
    house.pass_time(1e6)
    assert house.conductor.state == "idle"
    session = house.begin("home")
    house.want(session, "paused")
    house.pass_time(1e6)
    assert house.conductor.state == "paused"


def test_a_late_word_of_a_job_that_is_over_changes_nothing(house: House) -> None:
    """States, events and ends of a session that was closed are not another's."""
    old = house.begin("home")
    house.result("estop")
    house.pass_time(6.0)
    house.end(old, None)
    house.ask("reset")
    house.end_task()
    session = house.begin("home")
    assert not house.want(old, "paused")
    before = len(house.events)
    house.hear(Happened(old, "contact", {}))
    house.hear(Moved(old, GOOD, {}))
    house.end(old)
    assert len(house.events) == before
    assert house.result("status")["session"] == session


def test_one_job_at_a_time(house: House) -> None:
    """A second job is refused as busy, not queued."""
    house.begin("run")
    code, name, _ = house.error("home")
    assert (code, name) == (-32003, "busy")
    assert house.task() is None


def test_a_key_starts_one_session(house: House) -> None:
    """The same key again returns the same session, busy or done; another job's key is refused."""
    first = house.result("home", key="k")["session"]
    assert house.result("home", key="k")["session"] == first
    house.end(first)
    assert house.result("home", key="k")["session"] == first
    assert house.error("run", key="k")[1] == "invalid_params"
    assert house.result("home", key="l")["session"] != first


def test_a_key_is_kept_over_a_restart(make: Maker) -> None:
    """A client that sends its job again after a crash starts nothing."""
    session = make().known().result("home", key="k")["session"]
    assert make().known().result("home", key="k")["session"] == session


@pytest.mark.parametrize(
    ("view", "method", "name"),
    [
        (replace(GOOD, arm=GOOD.arm | {"connected": False}), "home", "unavailable"),  # type: ignore[operator]
        (replace(GOOD, camera_connected=False), "capture", "unavailable"),
        (replace(GOOD, memory=Memory()), "home", "precondition"),
        (GOOD, "calibrate", "precondition"),
        (GOOD, "verify", "precondition"),
        (GOOD, "massage", "precondition"),
    ],
)
def test_what_a_job_lacks_is_told(make: Maker, view: View, method: str, name: str) -> None:
    """Missing devices and missing knowledge refuse a job before it has a session."""
    house = make().known(view)
    assert house.error(method)[1] == name
    assert house.result("sessions")["sessions"] == []
    assert house.conductor.state == "idle"


def test_a_full_disk_refuses_jobs(make: Maker) -> None:
    """Below the configured room no session begins."""
    house = make(min_free_mb=1e12).known()
    assert house.error("home")[1] == "precondition"


def test_a_record_that_cannot_begin_is_a_refusal(house: House) -> None:
    """Where the folder cannot be made, there is no session and no crash."""
    house.store.folder.rmdir() if house.store.folder.exists() else None
    house.store.folder.write_text("in the way")
    assert house.error("home")[1] == "precondition"
    assert house.conductor.state == "idle"


def test_a_disk_that_fails_in_a_job_is_a_fault(house: House) -> None:
    """An event that cannot be recorded lets the arm come off the leg, then is fault `disk`."""
    session = house.begin("home")
    current = house.sessions.current
    assert current is not None
    assert current.writer is not None
    current.writer.close()
    house.hear(Happened(session, "progress", {"text": "on"}))
    assert house.conductor.state == "stopping"
    with pytest.raises(StopRequested):
        house.orders.look()
    house.end(session, "stopped")
    assert house.result("status")["fault"]["cause"] == "disk"
    with pytest.raises(Dropped):
        house.orders.look()
    assert house.result("session", session=session)["outcome"] == "fault"


def test_a_disk_that_fails_at_the_stop_lets_the_arm_retract_first(house: House) -> None:
    """Where the stop's own line is the first that is lost, the way off the leg goes on."""
    session = house.begin("home")
    current = house.sessions.current
    assert current is not None
    assert current.writer is not None
    current.writer.close()
    house.result("stop")
    house.hear(Happened(session, "progress", {"text": "on"}))
    house.pass_time(1.0)
    assert house.conductor.state == "stopping"
    with pytest.raises(StopRequested):
        house.orders.look()
    house.orders.look()  # the retract is broken off by nothing
    house.end(session, "stopped")
    assert house.result("status")["fault"]["cause"] == "disk"
    assert house.result("session", session=session)["outcome"] == "fault"


def test_a_fault_that_the_disk_did_not_keep_is_kept_once_it_can_be(house: House) -> None:
    """What the next start must know is tried again with each heartbeat, changed or not."""
    way = house.folder / ".state.json.tmp"
    way.mkdir()
    house.result("estop")
    assert house.store.load_state()["fault"] is None
    house.pass_time(1.1)
    way.rmdir()
    house.pass_time(1.1)
    assert house.store.load_state()["fault"]["cause"] == "estop"
