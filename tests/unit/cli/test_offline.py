"""Commands that need no daemon, on the simulated camera's own pictures and on real records."""

import json
from pathlib import Path

import numpy as np
import pytest

from legato.cli.exits import Exit
from legato.config.intrinsics import read_intrinsics
from legato.config.load import load
from legato.geometry.leg import Leg
from legato.records.store import Store
from legato.vision.picture import encode_png
from tests.unit.cli.samples import document, run


@pytest.fixture(scope="module")
def views(cell: Path) -> Path:
    """Return a folder of pictures that `legato snapshot` took, and one that shows nothing."""
    folder = cell.parent / "views"
    result = run("snapshot", "--config", cell, "--out", folder, "--views", "14", "--json")
    assert result.exit_code == 0, result.output
    assert len(document(result)["files"]) == 14
    blank = encode_png(np.full((576, 768), 128, dtype=np.uint8))
    (folder / "blank.png").write_bytes(blank)
    return folder


@pytest.fixture(scope="module")
def picture(cell: Path) -> Path:
    """Return a picture of the leg about where the paper lays it."""
    folder = cell.parent / "one"
    options = ("--views", "1", "--scatter-deg", "3", "--scatter-mm", "3")
    assert run("snapshot", "--config", cell, "--out", folder, *options).exit_code == 0
    return folder / "view-001.png"


def test_snapshots_differ_in_pose_and_repeat_by_seed(views: Path, cell: Path) -> None:
    """Each view has another leg pose; the same seed gives the same picture."""
    again = cell.parent / "again"
    run("snapshot", "--config", cell, "--out", again, "--views", "1")
    first = (views / "view-001.png").read_bytes()
    assert (again / "view-001.png").read_bytes() == first
    assert (views / "view-002.png").read_bytes() != first


def test_snapshots_are_never_overwritten(cell: Path, views: Path) -> None:
    """A folder with pictures of an earlier time is refused, with what to do; they stay."""
    before = (views / "view-001.png").read_bytes()
    options = ("--out", views, "--views", "1", "--seed", "5")
    result = run("snapshot", "--config", cell, *options)
    assert result.exit_code == Exit.USAGE
    assert "view-001.png" in result.stderr
    assert "another folder" in result.stderr
    assert (views / "view-001.png").read_bytes() == before


def test_a_picture_that_is_not_there_is_a_slip(cell: Path, views: Path, tmp_path: Path) -> None:
    """A wrong file name ends with 2 and names it, before anything is computed."""
    files = [*sorted(views.glob("*.png")), tmp_path / "none.png"]
    result = run("intrinsics", "--config", cell, *files, "--out", tmp_path / "found.toml")
    assert result.exit_code == Exit.USAGE
    assert "none.png" in result.stderr
    assert "view-001.png" not in result.stderr


def test_slips_are_told_before_anything_is_computed(cell: Path, picture: Path) -> None:
    """No folder for --out, a picture as --out, and a sigma that is no number end with 2."""
    for out, sigma, why in (
        (cell.parent / "none" / "x.toml", "0", "no folder"),
        (picture, "0", "one of the pictures"),
        (cell.parent / "x.toml", "nan", "'--mark-sigma': nan is no finite number"),
    ):
        options = ("--out", out, "--mark-sigma", sigma)
        result = run("intrinsics", "--config", cell, picture, *options)
        assert result.exit_code == Exit.USAGE
        assert why in result.stderr
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_leg_seen_alike_again_is_no_new_view(cell: Path, picture: Path, tmp_path: Path) -> None:
    """Ten copies of one picture are one view, and too few."""
    files = [tmp_path / f"copy-{n}.png" for n in range(10)]
    for file in files:
        file.write_bytes(picture.read_bytes())
    result = run("intrinsics", "--config", cell, *files, "--out", tmp_path / "x.toml")
    assert result.exit_code == Exit.REFUSED
    assert "copy-9.png: shows the leg just as" in result.stderr
    assert "1 view is too few" in result.stderr


def test_swapped_picks_are_left_out_and_named(cell: Path, picture: Path, tmp_path: Path) -> None:
    """Two names in each other's places: document, warning and text say what is left out."""
    marks = document(run("detect", picture, "--config", cell, "--json"))["marks"]
    marks["P6"], marks["P7"] = marks["P7"], marks["P6"]
    picks = tmp_path / "picks.json"
    picks.write_text(json.dumps(marks))
    result = run("solve", picture, "--config", cell, "--picks", picks, "--json")
    found = document(result)
    assert found["left_out"] == ["P6", "P7"]
    assert "P6, P7" in found["warnings"][0]
    assert "without P6 and P7" in result.stderr
    assert set(found["marks"]) >= {"P6", "P7"}


def test_intrinsics_are_found_from_snapshots(cell: Path, views: Path, tmp_path: Path) -> None:
    """From the pictures the true camera is found within its sigmas; the blank one is named."""
    out = tmp_path / "found.toml"
    files = sorted(views.glob("*.png"))
    result = run("intrinsics", "--config", cell, *files, "--out", out, "--json")
    assert result.exit_code == 0, result.output
    told, found = document(result), read_intrinsics(out)
    assert "blank.png" in " ".join(told["left_out"])
    assert found.views == told["views"] >= 10
    truth = load(cell).config.sim
    for name in ("alpha_u", "alpha_v", "u0", "v0", "k1"):
        error = abs(getattr(found, name) - getattr(truth, name))
        assert error < 4.0 * told["sigma"][name], name
    assert abs(found.alpha_u / truth.alpha_u - 1.0) < 0.003


def test_marks_pasted_by_hand_are_estimated_too(cell: Path, views: Path, tmp_path: Path) -> None:
    """On request the marks' places move: where [leg] has one 0.4 mm off, the file says so."""
    text = cell.read_text() + "[leg.marks]\n"
    for name, (x, y, z) in Leg().marks.items():
        off = 0.4 if name == "P6" else 0.0
        text += f"{name} = [{x + off}, {y + off * Leg().slope}, {z}]\n"
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(text)
    out, files = tmp_path / "found.toml", sorted(views.glob("view-*.png"))
    options = ("--mark-sigma", "0.2", "--out", out)
    result = run("intrinsics", "--config", wrong, *files, *options, "--json")
    assert result.exit_code == 0, result.output
    found, truth = read_intrinsics(out), Leg().marks
    assert abs(found.alpha_u / load(cell).config.sim.alpha_u - 1.0) < 0.003
    assert len(found.view_rms_px) == found.views
    assert set(found.mark_rms_px) == set(found.marks) == set(truth)
    assert "P6" in result.stderr
    moved = {n: np.linalg.norm(np.subtract(found.marks[n], truth[n])) for n in truth}
    assert moved["P6"] < 0.1
    assert max(moved.values()) < 0.15


def test_intrinsics_too_old_or_of_the_future_are_refused(
    cell: Path, picture: Path, tmp_path: Path
) -> None:
    """An intrinsics file past its days is refused by solve and told by check; so is tomorrow's."""
    for created, days, why in (
        ("2020-01-01", "730.0", "days old, 730 are allowed"),
        ("2999-01-01", "36500.0", "days from now"),
    ):
        old = tmp_path / "cell.toml"
        old.write_text(cell.read_text().replace("36500.0", days))
        lens = (cell.parent / "lens.toml").read_text()
        (tmp_path / "lens.toml").write_text(lens.replace("2026-11-20T10:00:00+00:00", created))
        result = run("solve", picture, "--config", old, "--json")
        assert result.exit_code == Exit.REFUSED
        found = document(result)
        assert found["accepted"] is False
        assert why in found["reasons"][0]
        assert found["hint"]
        assert run("check", "--config", old).exit_code == (Exit.USAGE if days == "730.0" else 0)
        free = tmp_path / "free.toml"
        free.write_text(old.read_text() + "[calibration]\nintrinsics = 'free'\n")
        assert "days old" not in run("solve", picture, "--config", free).output


def test_too_few_pictures_are_refused_by_name(cell: Path, views: Path, tmp_path: Path) -> None:
    """Fewer than ten usable pictures give no file; each unusable one is named with its reason."""
    torn = tmp_path / "torn.png"
    torn.write_bytes((views / "view-001.png").read_bytes()[:5000])
    out = tmp_path / "found.toml"
    wrong = [views / "blank.png", torn]
    result = run("intrinsics", "--config", cell, *wrong, "--out", out)
    assert result.exit_code == Exit.REFUSED
    for file in wrong:
        assert file.name in result.stderr
    assert not out.exists()


def test_detect_prints_the_marks(cell: Path, picture: Path) -> None:
    """All ten marks of a fair picture are found, each with two coordinates."""
    result = run("detect", picture, "--config", cell, "--json")
    assert result.exit_code == 0, result.output
    found = document(result)
    assert len(found["marks"]) + len(found["missing"]) == 10
    assert len(found["marks"]) >= 8
    assert all(len(place) == 2 for place in found["marks"].values())


def test_detect_on_a_blank_picture_fails_with_what_to_do(cell: Path, views: Path) -> None:
    """Where no leg is seen every mark is missing, and the code is 1."""
    result = run("detect", views / "blank.png", "--config", cell, "--json")
    assert result.exit_code == Exit.FAILED
    found = document(result)
    assert (found["marks"], len(found["missing"])) == ({}, 10)
    assert "what to do" in result.stderr


def test_solve_accepts_a_fair_picture(cell: Path, picture: Path) -> None:
    """With a known camera one picture gives a pose that every check accepts."""
    result = run("solve", picture, "--config", cell, "--json")
    assert result.exit_code == 0, result.output
    found = document(result)
    assert found["accepted"]
    assert found["reasons"] == []
    for key in ("camera_from_object", "world_from_object"):
        assert np.array(found[key]).shape == (4, 4)
    assert found["sigma"]["translation_mm"] < 0.5
    assert len(found["sigma"]["stations_mm"]) == 4
    assert found["seconds"] > 0


def test_solve_takes_picks_marks_and_engine(cell: Path, picture: Path, tmp_path: Path) -> None:
    """Picks of detect's own document give the same pose; --marks and --engine are heeded."""
    picks = tmp_path / "picks.json"
    picks.write_text(run("detect", picture, "--config", cell, "--json").stdout)
    options = ("--engine", "separable", "--marks", "P1,P2,P3,P5,P6,P8,P7", "--json")
    result = run("solve", picture, "--config", cell, "--picks", picks, *options)
    found = document(result)
    assert found["engine"] == "separable"
    assert set(found["marks"]) <= {"P1", "P2", "P3", "P5", "P6", "P7", "P8"}
    whole = document(run("solve", picture, "--config", cell, "--json"))
    apart = np.array(found["world_from_object"]) - np.array(whole["world_from_object"])
    assert np.abs(apart[:3, 3]).max() < 0.5


def test_solve_refuses_what_gives_no_pose(cell: Path, views: Path, picture: Path) -> None:
    """A blank picture, and marks in one plane, are refused with 3 and a reason."""
    blank = run("solve", views / "blank.png", "--config", cell, "--json")
    plane = run("solve", picture, "--config", cell, "--marks", "P2,P3,P4,P5,P6,P7", "--json")
    for result in (blank, plane):
        assert result.exit_code == Exit.REFUSED, result.output
        found = document(result)
        assert found["accepted"] is False
        assert found["reasons"]


def test_solve_refuses_marks_that_the_leg_has_not(cell: Path, picture: Path) -> None:
    """A wrong name is a wrong command line, with the names that there are."""
    for marks, why in (("P1,P99", "P99"), ("P1,P1", "once"), (",", "no mark"), ("", "no mark")):
        result = run("solve", picture, "--config", cell, "--marks", marks)
        assert result.exit_code == Exit.USAGE
        assert "P10" in result.stderr
        assert why in result.stderr


def test_sessions_are_listed_and_shown_without_a_daemon(cell: Path) -> None:
    """Records on disk are listed newest first; one is shown with states and contacts."""
    store = Store(cell.parent / "state")
    for minute, outcome in ((1, "done"), (2, "refused")):
        started = f"2026-11-22T01:0{minute}:00+00:00"
        meta = {"job": "run", "params": {}, "started": started, "simulated": True}
        writer = store.begin(meta)
        data = {"state": "capture", "previous": "idle", "cause": "run"}
        writer.event("state", data, t=1.0, wall=started)
        contact = {"station_mm": 7.0, "stroke": 1, "contact_mm": 0.1, "place_mm": 7.0}
        writer.event("contact", contact, t=2.0, wall=started)
        writer.finish(outcome, "why not", None, started)
    listed = document(run("sessions", "--config", cell, "--json"))
    assert [s["outcome"] for s in listed] == ["refused", "done"]
    shown = document(run("sessions", listed[0]["id"], "--config", cell, "--json"))
    assert (shown["states"], shown["contacts"][0]["contact_mm"]) == (["capture"], 0.1)
    text = run("sessions", "--config", cell, "--limit", "1").stdout
    assert "refused" in text
    assert "done" not in text
    other = run("sessions", "--state-dir", cell.parent / "elsewhere")
    assert "no sessions" in other.stdout


def test_a_session_that_is_not_there_is_an_error_in_words(cell: Path) -> None:
    """Neither a wrong id nor an empty store gives a traceback."""
    result = run("sessions", "../../etc", "--config", cell, "--json")
    assert result.exit_code == Exit.FAILED
    assert "no session id" in json.loads(result.stdout)["error"]["text"]
    empty = run("report", "--state-dir", cell.parent / "elsewhere")
    assert empty.exit_code == Exit.FAILED
    assert "legato demo" in empty.stderr


def test_a_report_makes_no_folders(cell: Path, tmp_path: Path) -> None:
    """A folder that is not there is a slip of the pen: refused, and nothing is made."""
    result = run("report", "--config", cell, "--out", tmp_path / "new" / "page.html")
    assert result.exit_code == Exit.USAGE
    assert f"no folder {tmp_path / 'new'}" in result.stderr
    assert not (tmp_path / "new").exists()
