"""What ends a campaign, and what it goes on after: stops, faults, resets, refusals."""

import pytest

from legato.daemon.gate import present
from legato.daemon.messages import FaultReport
from legato.daemon.orders import DoReset
from legato.hal.faults import Cause
from tests.unit.daemon.campaigning import begin, campaign, repetition, summary, taken
from tests.unit.daemon.house import CAMERA_LOST, House

ARM_TIMEOUT = FaultReport(Cause.ARM_TIMEOUT, "no answer", "see the arm", {})


@pytest.mark.parametrize("idle", [True, False])
def test_a_stop_ends_it_between_repetitions_too(house: House, idle: bool) -> None:
    """Whether a job runs or not, stop is accepted and nothing begins any more."""
    name, first = begin(house, job="capture", count=5, every_s=10.0)
    if idle:
        house.end(first)
        assert house.result("stop")["state"] == "idle"
    else:
        assert house.result("stop")["state"] == "stopping"
        assert campaign(house)["underway"]
        house.end(first, "stopped")
    house.pass_time(100.0)
    assert taken(house) is None
    told = summary(house, name)
    assert (told["outcome"], told["reason"]) == ("stopped", "stopped by local")
    assert [row["outcome"] for row in told["sessions"]] == ["done" if idle else "stopped"]
    assert house.error("stop")[1] == "refused_in_state"
    assert house.begin("capture")


@pytest.mark.parametrize("estop", [True, False])
def test_the_stop_line_ends_it_in_idle_before_the_loop_has_looked(
    house: House, estop: bool
) -> None:
    """A stop that stands in the gate keeps the next repetition back, and ends the campaign."""
    name, first = begin(house, job="capture", count=5)
    house.end(first)
    house.orders.gate.ask("guard", present(), estop=estop)
    house.pass_time(0.0)
    assert taken(house) is None
    assert summary(house, name)["outcome"] == ("fault" if estop else "stopped")
    assert house.conductor.state == ("fault" if estop else "idle")


def test_end_campaign_lets_the_repetition_end(house: House) -> None:
    """The job under way is done; no other begins; a second request finds nothing to end."""
    name, first = begin(house, job="capture", count=5)
    assert house.result("end_campaign")["underway"]
    assert house.conductor.state == "capture"
    house.end(first)
    house.pass_time(1.0)
    assert taken(house) is None
    told = summary(house, name)
    assert (told["outcome"], told["reason"], told["done"]) == ("stopped", "ended by local", 1)
    assert house.error("end_campaign")[1] == "precondition"


def test_a_fault_of_the_camera_is_reset_and_the_campaign_goes_on(house: House) -> None:
    """After a while the cell is reset once, the next repetition begins; all of it is told."""
    name, first = begin(house, job="capture", count=3, resets=1)
    house.end(first, None, CAMERA_LOST)
    assert house.conductor.state == "fault"
    assert campaign(house)["next_in_s"] == 5.0
    house.pass_time(4.9)
    assert house.task() is None
    house.pass_time(0.2)
    house.end_task()
    assert house.conductor.state == "idle"
    second = repetition(house)
    repetition(house, CAMERA_LOST)
    house.pass_time(100.0)
    assert house.task() is None
    told = summary(house, name)
    assert (told["outcome"], told["done"], told["failed"]) == ("fault", 1, 2)
    assert [r["well"] for r in told["resets_done"]] == [True]
    assert [f["cause"] for f in told["faults"]] == ["camera_lost"] * 2
    assert told["sessions"][1]["id"] == second
    assert house.conductor.state == "fault"


def test_a_reset_that_fails_counts_and_is_tried_again_later(house: House) -> None:
    """A camera that stays away uses the resets up, each after a longer while."""
    name, first = begin(house, job="capture", count=3, resets=2)
    house.end(first, None, CAMERA_LOST)
    for wait in (5.0, 10.0):
        house.pass_time(wait - 0.1)
        assert house.task() is None
        house.pass_time(0.2)
        house.end_task(("the camera gives no picture", "plug it in"))
        assert house.conductor.state == "fault"
    house.pass_time(500.0)
    assert house.task() is None
    told = summary(house, name)
    assert told["outcome"] == "fault"
    assert "2 resets are used up" in told["reason"]
    assert [r["reason"] for r in told["resets_done"]] == ["the camera gives no picture"] * 2


def test_nothing_is_reset_after_the_last_repetition(house: House) -> None:
    """A reset serves to go on, and for nothing else: the fault stays for a person to see."""
    name, first = begin(house, job="capture", count=1, resets=5)
    house.end(first, None, CAMERA_LOST)
    house.pass_time(500.0)
    assert house.task() is None
    assert house.conductor.state == "fault"
    assert summary(house, name)["outcome"] == "fault"


@pytest.mark.parametrize(
    "cause", sorted(set(Cause) - {Cause.CAMERA_LOST, Cause.CAMERA_STALE}, key=str)
)
def test_every_other_fault_ends_it_whatever_was_allowed(house: House, cause: Cause) -> None:
    """No fault but the camera's own is ever reset by itself."""
    name, first = begin(house, job="capture", count=9, resets=100)
    house.end(first, None, FaultReport(cause, "so it is", "look", {}))
    house.pass_time(1000.0)
    assert house.task() is None
    assert house.conductor.state == "fault"
    assert summary(house, name)["outcome"] == "fault"


def test_somebodys_own_reset_takes_the_cell_over(house: House) -> None:
    """The fault is left, and the campaign is over: nothing begins behind a person's back."""
    name, first = begin(house, job="capture", count=9, resets=9)
    house.end(first, None, CAMERA_LOST)
    house.ask("reset")
    task = house.orders.next_task(0.0)
    assert isinstance(task, DoReset)
    assert summary(house, name)["reason"] == "local has sent reset"
    house.pass_time(100.0)
    assert house.task() is None


def test_a_stop_while_a_reset_is_awaited_ends_it(house: House) -> None:
    """In fault, stop has nothing to stop but the campaign; it is accepted for that."""
    name, first = begin(house, job="capture", count=9, resets=9)
    house.end(first, None, CAMERA_LOST)
    assert house.result("stop")["state"] == "fault"
    assert summary(house, name)["outcome"] == "stopped"
    house.pass_time(100.0)
    assert house.task() is None
    assert house.error("stop")[1] == "in_fault"


def test_a_reset_that_never_ends_is_given_up(house: House) -> None:
    """The fault stays, and a late success changes no state."""
    name, first = begin(house, job="capture", count=9, resets=9)
    house.end(first, None, CAMERA_LOST)
    house.pass_time(5.1)
    house.pass_time(61.0)
    assert "has not ended" in summary(house, name)["reason"]
    house.end_task()
    assert house.conductor.state == "fault"


def test_a_rejected_calibration_counts_as_failed_and_it_goes_on(house: House) -> None:
    """Refused is no fault: nothing has moved, and the next picture may be better."""
    name, first = begin(house, job="run", count=2)
    house.end(first, "refused")
    repetition(house)
    told = summary(house, name)
    assert (told["outcome"], told["done"], told["failed"]) == ("done", 1, 1)


def test_a_repetition_that_would_be_refused_ends_it(house: House) -> None:
    """The arm has lost its reference in between: no request, no motion."""
    name, first = begin(house, job="run", count=2)
    house.end(first)
    house.conductor.standing.view = house.conductor.standing.view.__class__(
        arm=house.conductor.standing.view.arm,
        camera_connected=False,
        memory=house.conductor.standing.view.memory,
    )
    house.pass_time(0.0)
    assert taken(house) is None
    told = summary(house, name)
    assert told["outcome"] == "refused"
    assert "camera is not connected" in told["reason"]


def test_a_deadman_that_lapses_between_repetitions_ends_it(house: House) -> None:
    """Begun under a lease with a deadman, it does not outlive the lease."""
    token = house.result("lease", duration_s=5.0, deadman=True)["lease"]
    name, first = begin(house, job="capture", count=9, every_s=10.0, lease=token)
    house.end(first)
    house.pass_time(10.0)
    house.pass_time(0.0)
    assert taken(house) is None
    assert "deadman has ended" in summary(house, name)["reason"]


def test_a_daemon_that_was_frozen_goes_on_with_nothing(house: House) -> None:
    """Stopped, or asleep with its machine: whoever woke it may stand at the arm."""
    awake = [1000.0]
    house.conductor.campaigns.awake = lambda: awake[0]
    name, first = begin(house, job="capture", count=9, every_s=10.0)
    house.end(first)
    awake[0] += 29.0
    house.pass_time(10.0)
    second = taken(house)
    assert second is not None
    house.end(second)
    awake[0] += 31.0
    house.pass_time(10.0)
    assert taken(house) is None
    told = summary(house, name)
    assert (told["outcome"], told["done"]) == ("interrupted", 2)
    assert "frozen for 31 s" in told["reason"]
