"""The conductor: every accepted job has one outcome, faults latch, time-outs end, stops win."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from legato.control.effects import PauseRequested, StopRequested
from legato.control.memory import Memory
from legato.control.states import deadline
from legato.daemon.messages import FaultReport, Happened, Looked, Moved, View, WorkerGone
from legato.daemon.orders import Dropped, Quit
from legato.hal.faults import Cause
from tests.unit.daemon.house import CAMERA_LOST, GOOD, House

Maker = Callable[..., House]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Maker]:
    """Give a maker of houses over one state folder; their records are let go at the end."""
    made: list[House] = []

    def maker(**given: Any) -> House:
        made.append(House(tmp_path, **given))
        return made[-1]

    yield maker
    for house in made:
        house.close()


@pytest.fixture
def house(make: Maker) -> House:
    """Give a house whose devices are known."""
    return make().known()


def session_json(house: House, session: str) -> dict[str, Any]:
    """Return a record's session.json."""
    path = house.store.folder / session / "session.json"
    found: dict[str, Any] = json.loads(path.read_text())
    return found


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


def test_a_stop_wins_over_the_next_state(house: House) -> None:
    """After stop the procedure gets no other state, and is told to stop."""
    session = house.begin("run")
    assert house.result("stop")["state"] == "stopping"
    assert not house.want(session, "calibrate")
    with pytest.raises(StopRequested):
        house.orders.look()
    assert house.want(session, "stopping")
    house.end(session, "stopped")
    assert house.conductor.state == "idle"
    assert house.result("session", session=session)["outcome"] == "stopped"


def test_stop_asked_twice_is_one_stop(house: House) -> None:
    """The second stop is accepted and changes nothing."""
    house.begin("run")
    house.result("stop")
    with pytest.raises(StopRequested):
        house.orders.look()
    house.result("stop")
    house.orders.look()


def test_pause_and_resume(house: House) -> None:
    """Paused is entered by the procedure, and left by resume."""
    session = house.begin("home")
    house.result("pause")
    with pytest.raises(PauseRequested):
        house.orders.look()
    assert house.want(session, "paused")
    assert house.error("pause")[1] == "refused_in_state"
    house.result("resume")
    house.orders.hold()
    assert house.want(session, "move_home")
    house.end(session)
    assert house.states()[-4:] == ["move_home", "paused", "move_home", "idle"]


@pytest.mark.parametrize("state", ["capture", "move_home", "massage_67", "paused", "stopping"])
def test_estop_in_every_state_is_a_fault_and_drops_the_job(house: House, state: str) -> None:
    """Estop is never refused; the worker sends nothing more and the session ends in fault."""
    session = house.begin("run")
    for step in ("calibrate", "verify", "move_home", "massage_67", "paused", "stopping"):
        if house.conductor.state == state:
            break
        house.want(session, step)
    assert house.conductor.state == state
    assert house.result("estop")["state"] == "fault"
    with pytest.raises(Dropped):
        house.orders.look()
    house.end(session, None)
    told = house.result("session", session=session)
    assert (told["outcome"], told["cause"]) == ("fault", "estop")
    assert house.of("fault")[0]["evidence"]["state"] == state
    assert session_json(house, session)["cause"] == "estop"


def test_estop_in_idle_and_in_fault(house: House) -> None:
    """Without a job it is a fault too; a fault that is latched keeps its first cause."""
    assert house.result("estop")["state"] == "fault"
    since = house.result("status")["fault"]["since"]
    house.pass_time(3.0)
    assert house.result("estop")["state"] == "fault"
    fault = house.result("status")["fault"]
    assert (fault["cause"], fault["since"], fault["session"]) == ("estop", since, None)


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


def test_an_estop_during_reset_wins(house: House) -> None:
    """A reset that succeeds after an estop leaves the cell in fault."""
    house.result("estop")
    house.ask("reset")
    call = house.calls
    house.result("estop")
    answer = house.answer(call)
    assert answer is not None
    assert answer["error"]["message"] == "in_fault"
    house.end_task()
    assert house.conductor.state == "fault"


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


def test_a_stop_that_came_with_the_last_effect_is_a_stop(house: House) -> None:
    """A job that was told to stop ends as stopped, though it had nothing left to do."""
    session = house.begin("home")
    assert house.result("stop")["state"] == "stopping"
    house.end(session, "done")
    assert house.result("session", session=session)["outcome"] == "stopped"


def test_progress_and_station_are_in_status(house: House) -> None:
    """Status tells the running session, its station and its last progress."""
    session = house.begin("run")
    for state in ("calibrate", "verify", "move_home", "massage_67"):
        house.want(session, state)
    house.hear(Happened(session, "progress", {"text": "stroke 1", "done": 4}))
    status = house.result("status")
    assert (status["session"], status["state"], status["station"]) == (session, "massage_67", 67.0)
    assert status["progress"] == {"text": "stroke 1", "done": 4}
    house.end(session)
    status = house.result("status")
    assert (status["session"], status["station"], status["progress"]) == (None, None, None)


def test_status_has_the_designs_keys(house: House) -> None:
    """The answer's shape is part of the wire."""
    status = house.result("status")
    assert list(status) == [
        "api", "version", "boot", "simulated", "state", "session", "station", "progress",
        "uptime_s", "arm", "camera", "calibration", "fault", "lease", "stop", "campaign",
    ]  # fmt: skip
    assert list(status["arm"]) == [
        "connected", "referenced", "xyz_mm", "pitch_deg", "roll_deg", "contact",
    ]  # fmt: skip
    assert status["camera"] == {"connected": True, "age_s": None}
    assert status["calibration"] is None
    house.hear(Looked(replace(GOOD, picture_at=house.now - 2.0)))
    assert house.result("status")["camera"]["age_s"] == pytest.approx(2.0)


def test_the_heart_beats_once_a_second(house: House) -> None:
    """Heartbeats come at 1 Hz whatever else happens, with the state."""
    for _ in range(20):
        house.pass_time(0.25)
    beats = house.of("heartbeat")
    assert 5 <= len(beats) <= 6
    assert beats[-1]["state"] == "idle"


def test_what_must_survive_is_kept(make: Maker) -> None:
    """Fault, reference and registers are in state.json at every change."""
    house = make().known()
    kept = house.store.load_state()
    assert (kept["fault"], kept["registers"]) == (None, [0] * 6)
    house.result("estop")
    assert house.store.load_state()["fault"]["cause"] == "estop"
    house.ask("reset")
    house.end_task()
    assert house.store.load_state()["fault"] is None
    house.hear(Looked(replace(GOOD, memory=Memory(None, (1, 0, 0, 0, 0, 0)))))
    assert house.store.load_state()["reference"] is None


def test_a_kept_fault_is_there_at_the_start(make: Maker) -> None:
    """A daemon that begins in fault says so to the first who asks and the first who listens."""
    fault = {"cause": "interrupted", "text": "t", "hint": "h", "since": "now", "session": "s"}
    house = make(fault=fault).known()
    assert house.states() == ["fault"]
    assert house.result("status")["fault"] == fault
    assert house.error("run")[1] == "in_fault"


def test_shutdown_lets_the_job_retract_first(house: House) -> None:
    """The end asks for a stop, waits for the job, then for the worker."""
    session = house.begin("home")
    assert house.result("shutdown")["state"] == "stopping"
    house.pass_time(0.1)
    assert house.task() is None
    house.end(session, "stopped")
    house.pass_time(0.1)
    assert house.task() == Quit()
    assert house.error("home")[1] == "unavailable"
    house.hear(WorkerGone())
    assert house.conductor.finished
    assert house.conductor.exit_code == 0


def test_shutdown_waits_for_nobody_for_ever(house: House) -> None:
    """A job that does not end is dropped and closed as interrupted; so is a stuck worker left."""
    session = house.begin("home")
    house.result("shutdown")
    house.pass_time(21.0)
    with pytest.raises(Dropped):
        house.orders.look()
    assert session_json(house, session)["outcome"] == "interrupted"
    house.pass_time(6.0)
    assert house.conductor.finished


def test_a_worker_that_dies_ends_the_daemon_with_an_outcome(house: House) -> None:
    """Its error is a fault of the session, and the process ends to be started again."""
    session = house.begin("home")
    house.hear(WorkerGone("Traceback: oops"))
    assert session_json(house, session)["outcome"] == "fault"
    assert house.store.load_state()["fault"]["cause"] == "internal"
    assert house.conductor.finished
    assert house.conductor.exit_code == 1


def test_evidence_is_published_and_recorded(house: House) -> None:
    """Arrays and other odd things in the evidence do no harm."""
    session = house.begin("home")
    evidence = {"at": GOOD.memory and GOOD.memory.registers, "odd": {1, 2}}
    house.end(session, "fault", FaultReport(Cause.LIMIT, "too far", "look", evidence))
    (fault,) = house.of("fault")
    assert fault["evidence"]["at"] == [0] * 6
    (event,) = house.store.read(session).of_kind("fault")
    assert event["data"]["cause"] == "limit"
