"""`legato campaign` and `legato campaigns`: what is asked, shown, and how they end."""

import json
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import pytest

from legato.cli.campaign import moment
from legato.cli.exits import Exit, Failure
from legato.daemon.campaign_files import CampaignFiles
from tests.unit.cli.samples import Event, FakeDaemon, document, run, write_cell

NAME = "20260301T100000Z-0001"
SUMMARY: dict[str, Any] = {
    "id": NAME, "job": "run", "outcome": "done", "reason": "2 repetitions", "total": 2, "done": 2,
    "failed": 0, "ended": "2026-03-01T11:00:00+00:00", "resets_done": [], "sessions": [],
    "contacts": {"7": {"count": 3, "mean_mm": 0.1, "sigma_mm": 0.01, "least_mm": 0, "most_mm": 1}},
}  # fmt: skip


def event(what: str, seq: int, **data: Any) -> Event:
    """Return one event of the campaign as the daemon sends it."""
    head = {"boot": "b", "seq": seq, "t": float(seq), "session": None, "id": NAME, "what": what}
    return "campaign", head | {"done": 0, "total": 2} | data


def daemon(**summary: Any) -> FakeDaemon:
    """Return a daemon on which a campaign runs and has ended."""
    return FakeDaemon(
        answers={
            "campaign": {"campaign": NAME, "session": "s1", "state": "capture"},
            "end_campaign": {"id": NAME},
            "status": {"campaign": {"id": NAME, "ended": "now"}},
            "campaigns": SUMMARY | summary,
        },
        batches=[[event("begun", 1), event("ended", 2, done=2, outcome="done")]],
    )


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """Return a simulated cell's file."""
    return write_cell(tmp_path)


def test_what_is_given_is_asked_for_and_the_summary_is_the_document(cell: Path) -> None:
    """Only what was given goes out; events are lines, and --json prints the summary."""
    fake = daemon()
    given = ["--count", "2", "--every", "60", "--resets", "1", "--key", "k", "--json"]
    result = run("campaign", "--config", cell, *given, daemon=fake)
    assert result.exit_code == Exit.DONE, result.output
    asked = {"job": "run", "count": 2, "every_s": 60.0, "resets": 1, "key": "k"}
    assert fake.asked[0] == ("campaign", asked)
    assert document(result) == SUMMARY
    assert f"begun {NAME}" in result.stderr


@pytest.mark.parametrize(
    ("summary", "code"),
    [
        ({"failed": 1}, Exit.FAILED),
        ({"outcome": "stopped"}, Exit.FAILED),
        ({"outcome": "fault"}, Exit.FAULT),
        ({"outcome": "interrupted"}, Exit.FAULT),
        ({"outcome": "refused"}, Exit.REFUSED),
    ],
)
def test_the_exit_code_tells_how_it_ended(cell: Path, summary: dict[str, Any], code: Exit) -> None:
    """Done is 0 only where every repetition was."""
    result = run("campaign", "--config", cell, "--count", "2", daemon=daemon(**summary))
    assert result.exit_code == code
    assert "station_mm" in result.output


def test_one_can_leave_and_end_it_later(cell: Path) -> None:
    """--no-wait returns at once, --end lets the repetition under way be the last."""
    result = run("campaign", "--config", cell, "--count", "2", "--no-wait", daemon=daemon())
    assert (result.exit_code, "has begun" in result.output) == (Exit.DONE, True)
    fake = daemon()
    result = run("campaign", "--config", cell, "--end", daemon=fake)
    assert result.exit_code == Exit.DONE
    assert fake.asked == [("end_campaign", {})]


def test_a_time_of_day_is_the_next_one_and_has_a_zone() -> None:
    """People say half past six; the daemon is told a moment that cannot be mistaken."""
    now = datetime(2026, 3, 1, 22, 0, tzinfo=timezone(timedelta(hours=1)))
    assert moment("06:30", now) == "2026-03-02T06:30:00+01:00"
    assert moment("23:05", now) == "2026-03-01T23:05:00+01:00"
    assert moment("2026-03-02T06:30:00+00:00", now) == "2026-03-02T06:30:00+00:00"
    assert datetime.fromisoformat(moment("2026-03-02T06:30", now)).tzinfo is not None
    for wrong in ("25:00", "soon"):
        with pytest.raises(Failure) as caught:
            moment(wrong, now)
        assert caught.value.code == Exit.USAGE


def test_campaigns_are_read_from_the_disk(cell: Path, tmp_path: Path) -> None:
    """No daemon is needed to see in the morning what came of the night."""
    result = run("campaigns", "--config", cell)
    assert "no campaigns" in result.output
    CampaignFiles(tmp_path / "state").write(NAME, SUMMARY)
    result = run("campaigns", "--config", cell)
    assert NAME in result.output
    result = run("campaigns", NAME, "--config", cell, "--json")
    assert json.loads(result.stdout) == SUMMARY
    result = run("campaigns", "20260301T100000Z-none", "--config", cell)
    assert result.exit_code == Exit.FAILED
