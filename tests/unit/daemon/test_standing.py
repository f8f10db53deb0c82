"""What the conductor tells and keeps: status, heartbeat, what survives, how the daemon ends."""

from dataclasses import replace

import pytest

from legato.control.memory import Memory
from legato.daemon.messages import FaultReport, Happened, Looked, WorkerGone
from legato.daemon.orders import Dropped, Quit
from legato.hal.faults import Cause
from tests.unit.daemon.house import GOOD, House, Maker, session_json


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
        "api", "version", "boot", "simulated", "simulated_devices", "state", "session",
        "station", "progress", "uptime_s", "arm", "camera", "calibration", "fault", "lacking",
        "lease", "stop", "campaign",
    ]  # fmt: skip
    assert list(status["arm"]) == [
        "connected", "referenced", "xyz_mm", "pitch_deg", "roll_deg", "contact",
    ]  # fmt: skip
    assert status["camera"] == {"connected": True, "age_s": None}
    assert status["calibration"] is None
    house.hear(Looked(replace(GOOD, picture_at=house.now - 2.0)))
    assert house.result("status")["camera"]["age_s"] == pytest.approx(2.0)


def test_status_says_what_an_idle_cell_lacks(house: House) -> None:
    """What would be refused is told with the reason and hint of the refusal; a busy cell's not."""
    lacking = house.result("status")["lacking"]
    assert sorted(lacking) == ["calibrate", "massage", "verify"]
    assert lacking["verify"] == {
        "reason": "there is no calibration to verify", "hint": "send calibrate first",
    }  # fmt: skip
    house.hear(Looked(replace(GOOD, camera_connected=False)))
    assert sorted(house.result("status")["lacking"]) == [
        "calibrate", "capture", "massage", "run", "verify",
    ]  # fmt: skip
    house.hear(Looked(GOOD))
    house.begin("home")
    assert house.result("status")["lacking"] == {}


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
    """A job that does not end is dropped at the deadline, in a fault that the next start finds."""
    session = house.begin("home")
    house.result("shutdown")
    house.pass_time(29.0)
    assert house.conductor.state == "stopping"
    house.pass_time(2.0)
    with pytest.raises(Dropped):
        house.orders.look()
    assert session_json(house, session)["outcome"] == "fault"
    assert house.store.load_state()["fault"]["cause"] == "deadline"
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
