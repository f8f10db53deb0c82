"""The pose of an earlier session: who found it, and what is shown of it."""

import json
import shutil
from pathlib import Path

import pytest

from legato.records.record import SessionRecord, read_session
from legato.report.devices import badge, cell, not_real
from legato.report.html import render
from legato.report.posed import Posed, pose_of, posed
from tests.unit.report.page import Page
from tests.unit.report.sessions import begun, whole_session


def pressing(whole: Path, folder: Path, job: str = "massage") -> SessionRecord:
    """Write a session that began with a whole one's pose, as the daemon does, beside it."""
    made = begun(folder / "later", job)
    picture = (whole / "frames" / "capture.png").read_bytes()
    place = made.writer.frame("start-calibrated", picture)
    made.writer.document("start", {"job": job, "calibrated": place, "picks": None})
    made.enter("massage_7", "idle", 0.0)
    made.massage(7.0, strokes=1)
    made.writer.finish("done", None, None, made.wall())
    target = folder / "sessions" / "20261122T024700Z-5f3a"
    shutil.move(made.writer.path, target)
    return read_session(target)


@pytest.fixture
def beside(tmp_path: Path) -> tuple[Path, SessionRecord]:
    """Return a whole session and one that pressed by its pose."""
    whole = whole_session(tmp_path)
    return whole, pressing(whole, tmp_path)


def test_a_massage_shows_the_pose_it_pressed_by(beside: tuple[Path, SessionRecord]) -> None:
    """Picture, residuals, tests and predicted bands are the earlier session's, which is named."""
    whole, record = beside
    page = Page(render(record))
    assert f"Pressed by the pose that session {whole.name} found" in page.text
    for part in ("Residuals", "Verify", "two bands", "predicted 1 \N{GREEK SMALL LETTER SIGMA} mm"):
        assert part in page.text
    assert "no pose was" not in page.text
    assert any("Marks, residuals" in alt for alt in page.pictures)


def test_the_lender_is_known_by_its_picture_alone(beside: tuple[Path, SessionRecord]) -> None:
    """Another picture beside it lends nothing, and what cannot be solved anew shows no pose."""
    whole, record = beside
    found = posed(record)
    assert isinstance(found, Posed)
    assert found.lender == whole.name
    assert found.calibration == read_session(whole).calibration | {  # type: ignore[operator]
        "picture": "frames/start-calibrated.png"
    }
    picture = whole / "frames" / "capture.png"
    picture.write_bytes(picture.read_bytes()[:-1] + b"?")
    again = posed(read_session(record.path))
    assert (again.calibration, pose_of(again)) == (None, None)
    assert "two bands" not in Page(render(again)).text


def test_a_session_with_a_pose_of_its_own_borrows_none(tmp_path: Path) -> None:
    """Nothing is said of another session."""
    record = read_session(whole_session(tmp_path))
    assert posed(record) is record
    assert pose_of(record) is None


@pytest.mark.parametrize(
    ("told", "kind"),
    [
        ({"simulated": False}, "real"),
        ({"simulated": True}, "simulated"),
        ({"simulated": True, "simulated_devices": ["arm", "camera"]}, "simulated"),
        ({"simulated": True, "simulated_devices": ["camera"]}, "simulated camera"),
        ({"simulated": True, "simulated_devices": ["arm"]}, "simulated arm"),
    ],
)
def test_one_simulated_device_is_named(told: dict[str, object], kind: str) -> None:
    """A badge says which device was simulated; without the key it is both."""
    assert cell(told) == kind
    assert badge(told) == ("" if kind == "real" else kind.upper())
    assert bool(not_real(told)) == (kind != "real")


def test_the_report_says_which_device_was_simulated(tmp_path: Path) -> None:
    """A real arm that moved by simulated pictures is not told as none."""
    path = begun(tmp_path).writer.path
    meta = json.loads((path / "session.json").read_text())
    changed = meta | {"simulated": True, "simulated_devices": ["camera"]}
    (path / "session.json").write_text(json.dumps(changed))
    text = Page(render(read_session(path))).text
    assert "session report SIMULATED CAMERA" in text
    assert "a real arm moved" in text
