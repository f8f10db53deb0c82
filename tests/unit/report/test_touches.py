"""Contacts as they are counted: pauses, and the touch that ends a session."""

from pathlib import Path

import pytest

from legato.records.record import SessionRecord, read_session
from legato.report.bands import bands_told, contact_bands
from legato.report.compare import compare
from legato.report.facts import profiles
from legato.report.html import content, render
from legato.report.score import score
from legato.report.strokes import strokes_of
from legato.report.touches import contacts, counted, ended_by
from tests.unit.report.page import Page, svg_of
from tests.unit.report.sessions import Cell, begun, surface

PAUSE_S = 60.0


def broken_off(state_dir: Path) -> Cell:
    """Touch at 7 mm, come off for a pause, and make the stroke again and a second one."""
    cell = begun(state_dir)
    cell.enter("calibrate", "capture")
    cell.calibrate()
    cell.enter("massage_7", "calibrate", 0.0)
    cell.massage(7.0, strokes=1)
    cell.enter("paused", "massage_7", PAUSE_S)
    cell.enter("massage_7", "paused", 0.0)
    cell.massage(7.0, strokes=2)
    cell.testify()
    return cell


@pytest.fixture(scope="module")
def paused(tmp_path_factory: pytest.TempPathFactory) -> SessionRecord:
    """Return a record whose first stroke was broken off by a pause."""
    return read_session(broken_off(tmp_path_factory.mktemp("paused")).writer.path)


def test_a_stroke_made_again_counts_once_and_by_its_last_contact(paused: SessionRecord) -> None:
    """Tiles, comparison, score and true touches agree; the earlier contact is listed."""
    rows = contacts(paused)
    assert [(r["stroke"], r["again"], r["counts"]) for r in rows] == [
        (1, False, False), (1, True, True), (2, False, True),
    ]  # fmt: skip
    assert counted(rows) == rows[1:]
    assert compare([paused, paused]).sides[0].strokes == 2
    told = score(paused)
    assert told.stations[0].strokes == 2
    assert [(t.station_mm, t.stroke) for t in told.touches] == [(7.0, 1), (7.0, 2)]
    page = Page(render(paused))
    assert "2 strokes with contact" in page.text
    assert page.text.count("again after a pause") == 1


def test_a_pause_is_no_part_of_a_stroke(paused: SessionRecord) -> None:
    """A profile begins when the arm goes on, and not when it was paused."""
    spans = strokes_of(paused)
    assert [s.number for s in spans] == [1, 1, 2]
    assert max(s.ended - s.began for s in spans) < PAUSE_S / 4
    for times, _, _ in profiles(paused, paused.calibration or {})[7.0]:
        assert 0.0 <= times[0] <= times[-1] < PAUSE_S / 4


def test_the_touch_that_ended_a_session_is_drawn_and_listed(tmp_path: Path) -> None:
    """An early contact has a place in figure and table, and is no stroke's contact."""
    cell = begun(tmp_path)
    cell.calibrate()
    cell.enter("massage_67", "idle")
    evidence = {"station_mm": 67.0, "height_mm": 3.5082591188223606}
    cell.event("fault", cause="contact_early", text="too early", hint="look", evidence=evidence)
    cell.writer.finish("fault", "too early", "contact_early", cell.wall())
    record = read_session(cell.writer.path)
    found = ended_by(record)
    assert found is not None
    place, up = surface(cell.believed, 67.0)
    assert found["touched_z_mm"] == pytest.approx(place[2] + 3.5082591 * up[2])
    page = Page(render(record))
    assert "the touch that ended it" in page.text
    assert "height 3.51 mm" in page.text
    assert "strokes with contact" not in page.text
    assert "the touch that ended it" in svg_of(page, "Touched height")


def test_no_band_is_told_of_that_there_is_not(paused: SessionRecord) -> None:
    """Without a pose the contact window alone is left; without either there is no band."""
    assert "two bands" in bands_told(contact_bands(paused).values())
    paused_without = read_session(paused.path)
    paused_without.__dict__["calibration"] = None
    told = content(paused_without)["bands_told"]
    assert "one band" in told
    assert "predicted" not in told
    assert "no band" in bands_told([])
