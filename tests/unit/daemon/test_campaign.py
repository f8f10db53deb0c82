"""Campaigns: repeated as asked, kept on disk, ended by every hand and fault but the camera's."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from legato.daemon.campaign_files import CampaignFiles, close_interrupted
from legato.daemon.gate import present
from legato.daemon.messages import FaultReport, Happened
from legato.daemon.orders import DoJob, DoReset
from legato.hal.faults import Cause
from tests.unit.daemon.bench import Silent
from tests.unit.daemon.house import CAMERA_LOST, House

ARM_TIMEOUT = FaultReport(Cause.ARM_TIMEOUT, "no answer", "see the arm", {})
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


def begin(house: House, **asked: Any) -> tuple[str, str]:
    """Begin a campaign; return its id and its first session, which the worker has taken."""
    told = house.result("campaign", **asked)
    assert taken(house) == told["session"]
    return told["campaign"], told["session"]


def taken(house: House) -> str | None:
    """Return the session of the job that the worker is given next, None where there is none."""
    task = house.task()
    assert task is None or isinstance(task, DoJob)
    return task.session if task is not None else None


def campaign(house: House) -> dict[str, Any]:
    """Return what status tells of the campaign."""
    found: dict[str, Any] = house.result("status")["campaign"]
    return found


def summary(house: House, name: str) -> dict[str, Any]:
    """Return a campaign's document as it stands on the disk."""
    path = house.store.state_dir / "campaigns" / f"{name}.json"
    found: dict[str, Any] = json.loads(path.read_text())
    return found


def repetition(house: House, fault: FaultReport | None = None) -> str:
    """Let the next repetition begin and end; return its session."""
    house.pass_time(0.0)
    session = taken(house)
    assert session is not None
    house.end(session, None if fault else "done", fault)
    return session


def test_a_campaign_of_three_is_three_sessions_and_a_summary(house: House) -> None:
    """Each repetition is a session of its own; idle is between them; then it is done."""
    name, first = begin(house, job="capture", count=3)
    house.end(first)
    assert house.conductor.state == "idle"
    sessions = [first, repetition(house), repetition(house)]
    assert len(set(sessions)) == 3
    told = campaign(house)
    assert (told["done"], told["failed"], told["total"]) == (3, 0, 3)
    assert (told["outcome"], told["underway"], told["next_in_s"]) == ("done", False, None)
    kept = summary(house, name)
    assert [row["id"] for row in kept["sessions"]] == sessions
    assert (kept["outcome"], kept["by"], kept["simulated"]) == ("done", "local", True)
    meta = json.loads((house.store.folder / first / "session.json").read_text())
    assert (meta["campaign"], meta["params"], meta["by"]) == (name, {}, "local")
    house.pass_time(60.0)
    assert taken(house) is None
    assert [e["what"] for e in house.of("campaign")] == [
        "begun", "session", "repetition", "session", "repetition", "ended",
    ]  # fmt: skip


def test_repetitions_begin_every_so_often_until_the_time_is_over(house: House) -> None:
    """The interval is from start to start; one that would begin too late does not begin."""
    _, first = begin(house, job="capture", every_s=10.0, for_s=25.0)
    house.pass_time(4.0)
    house.end(first)
    assert campaign(house)["next_in_s"] == 6.0
    house.pass_time(5.9)
    assert taken(house) is None
    house.pass_time(0.1)
    second = taken(house)
    assert second is not None
    house.pass_time(13.0)
    house.end(second)
    house.pass_time(0.0)
    third = taken(house)
    assert third is not None
    house.end(third)
    told = campaign(house)
    assert (told["done"], told["outcome"], told["reason"]) == (3, "done", "for 25 s")


def test_it_ends_at_a_time_of_day_whatever_the_wall_clock_does_meanwhile(house: House) -> None:
    """The time is taken from the wall once; then monotonic seconds count."""
    until = "2999-01-01T00:00:00+00:00"
    begin(house, job="capture", every_s=1.0, until=until)
    underway = house.conductor.campaigns.underway
    assert underway is not None
    session = underway.session
    assert session is not None
    house.end(session)
    house.pass_time(1.0)
    second = taken(house)
    assert second is not None
    house.end(second)
    house.now = underway.rule.ends_at
    house.pass_time(0.0)
    assert campaign(house)["reason"] == f"until {until}"
    assert taken(house) is None


@pytest.mark.parametrize(
    ("asked", "word"),
    [
        ({}, "an end"),
        ({"until": "2001-01-01T00:00:00+00:00"}, "past"),
        ({"until": "2999-01-01T00:00:00"}, "until"),
        ({"until": "tomorrow"}, "until"),
        ({"count": 0}, "count"),
        ({"count": 1, "job": "shutdown"}, "job"),
    ],
)
def test_a_campaign_without_an_end_to_come_is_refused(
    house: House, asked: dict[str, Any], word: str
) -> None:
    """Nothing begins, and the reason says what is wrong."""
    code, _, reason = house.error("campaign", **asked)
    assert code == -32602
    assert word in reason
    assert house.task() is None


def test_it_is_refused_where_its_job_would_be_and_leaves_nothing(make: Maker) -> None:
    """A precondition of the job is one of the campaign; no summary stays behind."""
    house = make().known()
    assert house.error("campaign", job="massage", count=2)[1] == "precondition"
    assert campaign(house) is None
    assert not list((house.store.state_dir / "campaigns").iterdir())
    house.begin("capture")
    assert house.error("campaign", count=2)[1] == "busy"


def test_between_repetitions_the_cell_is_the_campaigns(house: House) -> None:
    """What changes the cell is busy to everybody, with what to do."""
    _, first = begin(house, job="capture", count=2, every_s=60.0)
    house.end(first)
    for method in ("run", "home", "reference", "campaign"):
        given = {"count": 1} if method == "campaign" else {}
        assert house.error(method, **given)[1] == "busy", method
    house.pass_time(60.0)
    assert taken(house) is not None


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


def test_a_key_starts_one_campaign(house: House) -> None:
    """The same key again returns the same campaign, under way or long over."""
    told = house.result("campaign", job="capture", count=1, key="tonight")
    assert (
        house.result("campaign", job="capture", count=1, key="tonight")["campaign"]
        == (told["campaign"])
    )
    session = taken(house)
    assert session is not None
    house.end(session)
    again = house.result("campaign", job="capture", count=1, key="tonight")
    assert again["campaign"] == told["campaign"]
    assert taken(house) is None
    assert (
        house.result("campaign", job="capture", count=1, key="new")["campaign"]
        != (told["campaign"])
    )


def test_contacts_are_summed_up(house: House) -> None:
    """Count, mean, spread and ends of each station, of each session and of all."""
    name, first = begin(house, job="run", count=2)
    for height in (0.1, 0.3):
        data = {"station_mm": 7.0, "contact_mm": height}
        house.hear(Happened(first, "contact", data))
    house.end(first)
    house.pass_time(0.0)
    second = taken(house)
    assert second is not None
    house.hear(Happened(second, "contact", {"station_mm": 7.0, "contact_mm": 0.5}))
    house.end(second)
    told = summary(house, name)
    assert told["contacts"]["7"] == {
        "count": 3, "mean_mm": pytest.approx(0.3), "sigma_mm": pytest.approx(0.2),
        "least_mm": 0.1, "most_mm": 0.5,
    }  # fmt: skip
    assert [row["contacts"]["7"]["count"] for row in told["sessions"]] == [2, 1]


def test_a_shutdown_interrupts_it(house: House) -> None:
    """The daemon's end is the campaign's."""
    name, first = begin(house, job="capture", count=9)
    house.end(first)
    house.result("shutdown")
    assert summary(house, name)["outcome"] == "interrupted"


@pytest.mark.parametrize("running", [True, False])
def test_a_start_finds_it_interrupted_and_goes_on_with_nothing(make: Maker, running: bool) -> None:
    """Whether a repetition ran or not, the campaign is over, and status tells of it."""
    before = make().known()
    name, first = begin(before, job="capture", count=9)
    if not running:
        before.end(first)
    before.close()
    close_interrupted(CampaignFiles(before.store.state_dir), Silent())
    after = make().known()
    told = campaign(after)
    assert (told["id"], told["outcome"], told["underway"]) == (name, "interrupted", False)
    assert (told["done"], told["failed"]) == ((0, 1) if running else (1, 0))
    kept = summary(after, name)
    assert [row["outcome"] for row in kept["sessions"]] == ["interrupted" if running else "done"]
    after.pass_time(1000.0)
    assert after.task() is None
    close_interrupted(CampaignFiles(after.store.state_dir), Silent())
    assert summary(after, name) == kept


def test_a_disk_that_takes_no_summary_refuses_the_campaign_and_later_waits(house: House) -> None:
    """Nothing begins unrecorded; one that is under way is written as soon as the disk takes it."""
    folder = house.store.state_dir / "campaigns"
    folder.write_text("in the way")
    assert house.error("campaign", job="capture", count=2)[1] == "precondition"
    assert house.task() is None
    folder.unlink()
    name, first = begin(house, job="capture", count=1)
    kept = folder.rename(folder.with_name("away"))
    folder.write_text("in the way")
    house.end(first)
    folder.unlink()
    kept.rename(folder)
    assert summary(house, name)["outcome"] is None
    house.pass_time(5.0)
    house.pass_time(5.0)
    assert summary(house, name)["outcome"] == "done"


def test_campaigns_lists_and_shows_them(house: House) -> None:
    """Newest first without the long parts; one with all of them; an unknown one is refused."""
    name, first = begin(house, job="capture", count=1)
    house.end(first)
    (head,) = house.result("campaigns")["campaigns"]
    assert (head["id"], head["outcome"]) == (name, "done")
    assert "sessions" not in head
    whole = house.result("campaigns", campaign=name)
    assert [row["id"] for row in whole["sessions"]] == [first]
    assert whole["left_out"] == 0
    assert house.error("campaigns", campaign="../x")[1] == "invalid_params"


def test_the_daemon_looks_often_enough_and_not_too_often(house: House) -> None:
    """While it waits it is asked again before it is due, though the cell's time may run faster."""
    _, first = begin(house, job="capture", count=2, every_s=100.0)
    house.end(first)
    house.pass_time(0.0)
    assert house.conductor.campaigns.next_due(house.now) == house.now + 1.0
    house.pass_time(99.9)
    assert house.conductor.next_due() <= house.now + 0.03
