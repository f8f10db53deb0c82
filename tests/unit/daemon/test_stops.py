"""Stops and estops at the conductor: they win in every state, whatever else has come."""

import pytest

from legato.control.effects import PauseRequested, StopRequested
from legato.daemon.orders import Dropped
from tests.unit.daemon.house import House, session_json


def test_a_stop_wins_over_the_next_state(house: House) -> None:
    """After stop the procedure gets no other state and is told to stop; who asked is the reason."""
    session = house.begin("run")
    assert house.result("stop")["state"] == "stopping"
    assert not house.want(session, "calibrate")
    with pytest.raises(StopRequested):
        house.orders.look()
    assert house.want(session, "stopping")
    house.end(session, "stopped")
    assert house.conductor.state == "idle"
    assert house.result("session", session=session)["outcome"] == "stopped"
    assert session_json(house, session)["reason"] == "asked for by local"


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


def test_a_stop_that_came_with_the_last_effect_is_a_stop(house: House) -> None:
    """A job that was told to stop ends as stopped, though it had nothing left to do."""
    session = house.begin("home")
    assert house.result("stop")["state"] == "stopping"
    house.end(session, "done")
    assert house.result("session", session=session)["outcome"] == "stopped"
