"""The page of a session: whole, partial, torn; right, self-contained, of bounded size."""

import re
import sys
from pathlib import Path

import pytest
from matplotlib import rcParams

from legato.records.chain import EVENTS
from legato.records.record import SessionRecord, read_session
from legato.records.store import Store
from legato.report.facts import parameters
from legato.report.html import render, write_report
from tests.unit.report.page import Page, svg_of
from tests.unit.report.sessions import CONFIG, begun

FIGURES = (
    "Marks, residuals, leg outline",
    "Each mark enlarged",
    "Best and mean cost",
    "from above, from the side and from the end",
    "way over the picture",
    "Touched height",
    "Height over the predicted surface in each stroke",
    "States over time",
)


def test_a_whole_session_has_every_part(whole_page: str) -> None:
    """Every section and every figure is there, each figure an SVG picture of its own."""
    page = Page(whole_page)
    for heading in ("What was asked", "What the camera saw", "Residuals", "The search", "Verify",
                    "Parameters", "The trajectory", "Contacts", "Against the simulated truth",
                    "Timeline", "Environment", "Configuration"):  # fmt: skip
        assert heading in page.text
    for alt in FIGURES:
        assert svg_of(page, alt).startswith("<svg")
    assert "data:image/jpeg" in page.pictures["Picture frames/capture.png"]


def test_the_facts_are_the_records(whole: SessionRecord, whole_page: str) -> None:
    """Outcome, contacts, parameters, checks, paper's figures and versions stand in the text."""
    text = Page(whole_page).text
    for fact in (
        "SIMULATED", "run: done", whole.id, "hash chain whole", "No touch outside a stroke",
        "hidden by glare", "652.000", "181.790", "not separately observable", "13.35 mm",
        "off by 0.100 deg and 0.269 mm", "c0ffee", "numpy 2.4.6", "held-out marks",
        "massage_7 → massage_67 → massage_127 → massage_187", "contact_window_mm",
    ):  # fmt: skip
        assert fact in text
    contacts = whole.of_kind("contact")
    assert len(contacts) == 12
    assert f"{contacts[0]['data']['place_mm']:.2f}" in text
    assert f"{len(whole.trajectory['t'])} motion commands" in text


def test_the_page_needs_nothing_else(whole_page: str) -> None:
    """It refers to nothing outside itself, runs no script, and holds text as text."""
    page = Page(whole_page)
    assert page.references
    assert all(r.startswith("data:image/") for r in page.references)
    assert "script" not in page.tags
    assert "http://" not in whole_page
    assert "https://" not in whole_page
    assert not re.search(r"url\(|@import", whole_page)
    assert "&lt;script&gt;alert(1)" in whole_page
    assert len(whole_page) < 3_000_000


def test_the_page_is_written_beside_the_record(whole: SessionRecord, tmp_path: Path) -> None:
    """By default as report.html in the session's folder, else where it is asked for."""
    assert write_report(whole) == whole.path / "report.html"
    other = write_report(whole, tmp_path / "new" / "page.html")
    assert other.read_text(encoding="utf-8").startswith("<!doctype html>")


def test_figures_do_not_touch_global_settings(whole: SessionRecord) -> None:
    """Settings of matplotlib are as they were, and no pyplot was brought in."""
    before, pyplot = dict(rcParams), "matplotlib.pyplot" in sys.modules
    render(whole)
    assert dict(rcParams) == before
    assert ("matplotlib.pyplot" in sys.modules) == pyplot


def test_a_session_that_never_began_its_work(tmp_path: Path) -> None:
    """A record of nothing but its request and outcome gives a page that says so."""
    cell = begun(tmp_path)
    cell.writer.finish("refused", "the arm is not referenced", None, "2026-11-22T01:47:01+00:00")
    page = Page(render(read_session(cell.writer.path)))
    assert "run: refused" in page.text
    assert "the arm is not referenced" in page.text
    assert "No change of state is recorded" in page.text
    assert page.pictures == {}
    for part in ("Contacts", "The trajectory", "Verify", "Residuals"):
        assert part not in page.text


def test_a_fault_before_calibration(tmp_path: Path) -> None:
    """Cause, hint and evidence stand on top, and the picture that was taken is shown."""
    cell = begun(tmp_path, "capture")
    cell.enter("capture", "idle")
    cell.look()
    cell.event("fault", cause="marks_not_found", text="only 3 marks in the picture",
               hint="light the leg", evidence={"candidates": 3, "where": [1.25, 2.0]})  # fmt: skip
    cell.writer.finish("fault", "only 3 marks", "marks_not_found", "2026-11-22T01:47:03+00:00")
    page = Page(render(read_session(cell.writer.path)))
    for fact in ("capture: fault", "marks_not_found", "only 3 marks in the picture",
                 "light the leg", "candidates 3", "where 1.25, 2", "no pose was found",
                 ):  # fmt: skip
        assert fact in page.text
    assert page.text.index("light the leg") < page.text.index("What was asked")
    assert set(page.pictures) == {"The camera's picture", "States over time"}


def test_a_refused_calibration(tmp_path: Path) -> None:
    """A session refused by verify shows which test failed, with its figure and what to do."""
    cell = begun(tmp_path)
    cell.enter("verify", "calibrate")
    cell.look()
    cell.calibrate(accepted=False)
    cell.writer.finish("refused", "P10 is off", "calibration_rejected", "2026-11-22T01:47:03Z")
    text = Page(render(read_session(cell.writer.path))).text
    assert "Not accepted." in text
    assert "5.2 4 sigma fails" in text
    assert "What to do: look at P10" in text
    assert "The trajectory" not in text


def test_a_session_broken_off_in_a_pass(tmp_path: Path) -> None:
    """A torn record says so on top and shows what was written before the tear."""
    cell = begun(tmp_path)
    cell.calibrate()
    cell.enter("massage_7", "move_home")
    cell.massage(7.0, strokes=1)
    cell.writer.close()
    with (cell.writer.path / EVENTS).open("ab") as file:
        file.write(b'{"seq": 99, "wa')
    running = Page(render(read_session(cell.writer.path))).text
    assert "no outcome yet" in running
    assert "This record is torn" in running
    Store(tmp_path).close_interrupted(cell.writer.id)
    page = Page(render(read_session(cell.writer.path)))
    assert "run: interrupted" in page.text
    assert "broke it off after event 3" in page.text
    assert page.text.index("This record is torn") < page.text.index("What was asked")
    assert "hash chain whole" not in page.text
    assert "from above, from the side and from the end" in " ".join(page.pictures)


def test_a_changed_record_is_called_out(tmp_path: Path) -> None:
    """A line that was changed after the fact stands at the top of the page."""
    cell = begun(tmp_path)
    cell.enter("capture", "idle")
    cell.enter("idle", "capture")
    cell.writer.finish("done", None, None, "2026-11-22T01:47:03+00:00")
    path = cell.writer.path / EVENTS
    path.write_bytes(path.read_bytes().replace(b'"capture"', b'"verify"', 1))
    text = Page(render(read_session(cell.writer.path))).text
    assert "not as they were written: line 1 is changed" in text


@pytest.mark.parametrize("part", ["calibration.json", "trajectory.csv", "frames/capture.png"])
def test_a_damaged_part_costs_only_itself(tmp_path: Path, part: str) -> None:
    """Junk in one file leaves the page with everything else."""
    cell = begun(tmp_path)
    cell.look()
    cell.calibrate()
    cell.massage(7.0, strokes=1)
    (cell.writer.path / part).write_bytes(b"\x89PNG junk \xff\xfe{")
    text = Page(render(read_session(cell.writer.path))).text
    assert "Contacts" in text


def test_a_job_alone_and_a_real_cell(tmp_path: Path) -> None:
    """A real session is not called simulated, and a massage without a solve shows its way."""
    writer = Store(tmp_path).begin(
        {"job": "home", "started": "2026-11-22T01:47:00Z", "simulated": False, "config": CONFIG}
    )
    cell = begun(tmp_path / "other", "home")
    cell.writer = writer
    cell.enter("move_home", "idle")
    cell.to([127.0, 30.0, 150.0], "transit")
    writer.finish("done", None, None, "2026-11-22T01:47:03Z")
    page = Page(render(read_session(writer.path)))
    assert "SIMULATED" not in page.text
    assert "Against the simulated truth" not in page.text
    assert any("from above" in alt for alt in page.pictures)


def test_paper_engine_without_known_camera(tmp_path: Path) -> None:
    """A parameter on its bound is marked, and a cost that was not finite leaves a gap."""
    cell = begun(tmp_path)
    cell.calibrate(accepted=False)
    record = read_session(cell.writer.path)
    solved = record.calibration
    assert solved is not None
    solved["engine"], solved["intrinsics"] = "paper", "free"
    solved["trace"] = {"best": [None, 5.0, 4.0], "mean": [None, None, 40.0]}
    for gene in solved["parameters"]:
        gene["searched"] = True
    solved["parameters"][3] |= {"value": 360.0, "on_bound": True}
    text = Page(render(record)).text
    assert "Engine paper" in text
    assert "on its bound" in text
    assert "known, not searched" not in text
    assert "alpha_u" not in [row["name"] for row in parameters(solved)]
    assert "100 %" not in text
    assert "candidates agree" not in text
