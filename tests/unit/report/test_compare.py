"""Sessions side by side: spreads that are known beforehand, pages for few and for many."""

import base64
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from legato.geometry.transforms import rotation_from_vector, transform
from legato.records.record import SessionRecord, read_session
from legato.report.campaign import SIDE_BY_SIDE, apart, write_comparison
from legato.report.compare import MIDDLE, compare
from legato.report.figures import campaign
from tests.unit.report.sessions import STATIONS, begun


@pytest.fixture
def twice(whole_path: Path, tmp_path: Path) -> tuple[SessionRecord, SessionRecord]:
    """Return one session and a copy of it under another name."""
    copy = tmp_path / f"{whole_path.name[:-4]}beef"
    shutil.copytree(whole_path, copy)
    return read_session(whole_path), read_session(copy)


def changed(record: SessionRecord, **solved: Any) -> None:
    """Give a record another calibration."""
    record.__dict__["calibration"] = {**(record.calibration or {}), **solved}


def test_equal_sessions_differ_in_nothing(twice: tuple[SessionRecord, SessionRecord]) -> None:
    """Spreads between them are zero, strokes spread as in each, and no key is different."""
    found = compare(twice)
    assert [s.id for s in found.sides] == [r.id for r in twice]
    assert found.pose_sd_mm == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert [s.station_mm for s in found.stations] == list(STATIONS)
    assert all(s.between == pytest.approx(0.0, abs=1e-12) for s in found.stations)
    assert found.differences == ()
    assert not found.mixed


def test_a_leg_that_moved_by_a_known_step_shows_it(
    twice: tuple[SessionRecord, SessionRecord],
) -> None:
    """A turn about the leg's middle and a shift come out as they went in, half on each side."""
    first, second = twice
    pose = np.asarray((first.calibration or {})["world_from_object"])
    turn = rotation_from_vector([0.0, 0.0, np.radians(1.0)])
    middle = (pose @ [*MIDDLE, 1.0])[:3]
    moved = transform(turn, middle - turn @ middle + [0.6, -0.2, 0.0]) @ pose
    changed(second, world_from_object=moved.tolist())
    found = compare((first, second))
    mine, other = (s.pose for s in found.sides)
    assert mine is not None
    assert other is not None
    assert np.subtract(other.shift_mm, mine.shift_mm) == pytest.approx([0.6, -0.2, 0.0], abs=1e-9)
    assert np.subtract(other.turn_deg, mine.turn_deg) == pytest.approx([0, 0, 1.0], abs=1e-6)
    assert found.pose_sd_mm == pytest.approx((0.6 / np.sqrt(2), 0.2 / np.sqrt(2), 0.0), abs=1e-9)


def test_spreads_within_and_between_are_told_apart(
    twice: tuple[SessionRecord, SessionRecord],
) -> None:
    """Contacts of 0, 2 and 10, 12 spread by sqrt 2 within, and their means by 10 / sqrt 2."""
    for record, heights in zip(twice, ((0.0, 2.0), (10.0, 12.0)), strict=True):
        record.events[:] = [
            {"seq": n, "wall": "", "t": float(n), "kind": "contact",
             "data": {"station_mm": 7.0, "stroke": n, "contact_mm": h, "place_mm": 7.0,
                      "across_mm": 0.0, "xyz_mm": [0.0, 0.0, h],
                      "predicted_xyz_mm": [0.0, 0.0, 0.0]}}
            for n, h in enumerate(heights, start=1)
        ]  # fmt: skip
    (station,) = compare(twice).stations
    assert station.mean == 6.0
    assert station.within == pytest.approx(np.sqrt(2.0))
    assert station.between == pytest.approx(10.0 / np.sqrt(2.0))
    assert station.span == 12.0


def test_what_was_configured_differently_is_named(
    twice: tuple[SessionRecord, SessionRecord],
) -> None:
    """Keys of tables within tables too; where the daemon listens is no difference."""
    twice[1].meta["config"] = {
        **twice[1].meta["config"],
        "massage": {"strokes": 5, "press_mm": 1.5, "contact_window_mm": 2.0},
        "server": {"requests": "tcp://127.0.0.1:9"},
    }
    (difference,) = compare(twice).differences
    assert (difference.key, difference.values) == ("massage.strokes", ("3", "5"))


def test_one_session_is_not_compared(whole: SessionRecord) -> None:
    """It is said, and no page is written."""
    with pytest.raises(ValueError, match="two or more"):
        compare([whole])


def test_the_page_of_two_has_columns_and_figures(
    twice: tuple[SessionRecord, SessionRecord], tmp_path: Path
) -> None:
    """Every plot is there, nothing is referred to, simulated stands on top, mixed is warned of."""
    twice[1].meta["simulated"] = False
    write_comparison(twice, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert page.count("data:image/svg+xml") == 4
    assert page.index("SIMULATED, SOME") < page.index("Side by side")
    assert "their figures do not mean the same" in page
    for record in twice:
        assert f"<td>{record.id}</td>" in page
    assert "http" not in page


def shown(uri: str | None) -> str:
    """Return a figure's SVG; its words are outlines, and stand in comments."""
    assert uri is not None
    return base64.b64decode(uri.partition(",")[2]).decode()


def test_every_state_is_drawn_where_it_came_and_named(
    twice: tuple[SessionRecord, SessionRecord],
) -> None:
    """Each has a name and a colour of its own; one that was come to twice is two bars."""
    found = compare(twice)
    svg = shown(campaign.durations(found))
    names = dict.fromkeys(stay.state for stay in found.sides[0].course if stay.state != "idle")
    assert {f"massage_{s:g}" for s in STATIONS} < set(names)
    for name in names:
        assert f"<!-- {name} -->" in svg
    bars = {re.search(r"fill: (#\w+)", bar[0])[1]  # type: ignore[index]
            for bar in re.finditer(r"<path[^>]*stroke: #ffffff[^>]*>", svg)}  # fmt: skip
    assert len(bars) == len(names)
    homes = [stay for stay in found.sides[0].course if stay.state == "move_home"]
    assert len(homes) == 2
    assert found.sides[0].stays["move_home"] == pytest.approx(sum(s.seconds for s in homes))


def test_each_station_has_a_panel_in_which_its_spread_is_seen(
    twice: tuple[SessionRecord, SessionRecord],
) -> None:
    """The panels name their stations; line, band and strokes are told in the legend."""
    for event in twice[1].events:
        if event["kind"] == "contact":
            event["data"]["contact_mm"] += 0.001
    svg = shown(campaign.contacts(compare(twice)))
    for station in STATIONS:
        assert f"<!-- {station:g} mm -->" in svg
    for words in ("stroke", "mean of the sessions", "± their standard deviation"):
        assert f"<!-- {words} -->" in svg


def test_what_is_the_same_in_all_is_said_once() -> None:
    """Figures that do not differ leave the table; those that do keep their order."""
    rows = [[("job", "run"), ("outcome", "done"), ("cell", "real")],
            [("job", "run"), ("outcome", "fault"), ("cell", "real")]]  # fmt: skip
    differing, alike = apart(rows)
    assert differing == [[("outcome", "done")], [("outcome", "fault")]]
    assert alike == [("job", "run"), ("cell", "real")]


def test_the_page_of_many_has_rows_and_takes_sessions_that_came_to_nothing(
    twice: tuple[SessionRecord, SessionRecord], tmp_path: Path
) -> None:
    """A session without calibration, motion or end stands among the others."""
    cell = begun(tmp_path)
    cell.enter("capture", "idle")
    empty = read_session(cell.writer.path)
    records = [*twice, empty] * 3
    assert len(records) > SIDE_BY_SIDE
    found = write_comparison(records, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert page.count(empty.id) >= 3
    assert "Session 3: This session has no outcome" in page
    assert found.sides[2].pose is None
    assert found.stations[0].contacts[2] == ()
