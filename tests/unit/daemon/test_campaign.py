"""Campaigns: repeated as asked, kept on disk, ended by every hand and fault but the camera's."""

import json
from typing import Any

import pytest

from legato.daemon.campaign_files import CampaignFiles, close_interrupted
from legato.daemon.messages import Happened
from tests.unit.daemon.bench import Silent
from tests.unit.daemon.campaigning import begin, campaign, repetition, summary, taken
from tests.unit.daemon.house import House, Maker


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


@pytest.mark.parametrize("over", [False, True])
@pytest.mark.parametrize(
    "other", [{"job": "home"}, {"count": 2}, {"every_s": 3.0}, {"for_s": 9.0}, {"resets": 1}]
)
def test_a_key_is_held_to_what_was_asked_with_it(
    make: Maker, over: bool, other: dict[str, Any]
) -> None:
    """Another campaign is refused, as a job is, whether the first is under way or long over."""
    house = make().known()
    asked = {"job": "capture", "count": 1, "key": "tonight"}
    name, session = begin(house, **asked)
    if over:
        house.end(session)
        house.close()
        house = make().known()
    assert house.result("campaign", **asked)["campaign"] == name
    code, _, reason = house.error("campaign", **(asked | other))
    assert code == -32602
    assert name in reason
    assert next(iter(other)) in reason
    assert house.task() is None


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
