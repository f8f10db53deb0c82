"""Summaries on the disk: heads without the long parts, and files that no daemon wrote."""

import json
from typing import Any

import pytest

from legato.daemon.campaign_files import CUT, LONG, CampaignFiles, close_interrupted
from tests.unit.daemon.bench import Silent
from tests.unit.daemon.campaigning import begin, campaign, summary
from tests.unit.daemon.house import House, Maker


def test_heads_are_read_without_the_long_parts_and_once(house: House) -> None:
    """The long parts come last; what is written later is in the list without another look."""
    name, first = begin(house, job="capture", count=1)
    house.end(first)
    assert tuple(summary(house, name))[-len(LONG) :] == LONG
    files = CampaignFiles(house.store.state_dir)
    path = files.folder / f"{name}.json"
    whole = path.read_bytes()
    path.write_bytes(whole[: whole.index(CUT) + len(CUT)])
    assert files.head(name) == {k: v for k, v in json.loads(whole).items() if k not in LONG}
    assert [head["id"] for head in files.heads()] == [name]
    path.unlink()
    files.write("20990101T000000Z-0000", {"job": "home", "sessions": []})
    files.write(name, {"job": "run", "done": 3})
    assert [(head["id"], head["job"], head["done"]) for head in files.heads()] == [
        ("20990101T000000Z-0000", "home", 0), (name, "run", 3),
    ]  # fmt: skip
    files.remove(name)
    assert len(files.heads()) == 1


def test_of_a_long_campaign_the_latest_sessions_are_shown(house: House) -> None:
    """A message has an end: so many are shown, and it says how many are not."""
    name = "20260301T100000Z-0000"
    rows = [{"id": str(n)} for n in range(1000)]
    CampaignFiles(house.store.state_dir).write(name, {"job": "run", "sessions": rows})
    told = house.result("campaigns", campaign=name)
    assert (told["job"], told["sessions"], told["left_out"]) == ("run", rows[-200:], 800)


@pytest.mark.parametrize(
    "odd",
    [
        {"sessions": 5, "failed": "x", "resets": [], "resets_done": 1, "session": 3, "ended": None},
        {"job": None, "ended": 5, "outcome": [], "resets": "many"},
        {"reason": "x" * 9000, "ended": None},
        {},
    ],
)
def test_a_summary_that_nobody_wrote_holds_nothing_up(make: Maker, odd: dict[str, Any]) -> None:
    """A start closes it as far as it can be, and status, lists and keys are answered."""
    house = make()
    files = CampaignFiles(house.store.state_dir)
    files.write("20260301T100000Z-0000", odd | {"contacts": {}})
    (files.folder / "20260301T100000Z-0001.json").write_bytes(b"{")
    (files.folder / "99999999T999999Z-0002.json").write_bytes(b"{}")
    close_interrupted(files, Silent())
    house.known()
    assert campaign(house)["underway"] is False
    (head,) = house.result("campaigns")["campaigns"]
    assert head["ended"] is not None
    assert house.result("campaign", job="capture", count=1, key="k")["campaign"]
