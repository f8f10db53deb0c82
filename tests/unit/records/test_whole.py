"""A whole record is held to its seal: whatever file is changed or lost is named."""

from pathlib import Path

import pytest

from legato.records.files import encode, read_object
from legato.records.session import SessionWriter
from legato.records.store import Store
from legato.records.trajectory import COMMANDED
from legato.records.whole import verify_record
from tests.unit.records.conftest import Begin

ENDED = "2026-11-22T02:00:00+00:00"


@pytest.fixture
def path(begin: Begin) -> Path:
    """Return the folder of a finished session with every kind of file."""
    writer = begin(2)
    fill(writer)
    told = {"id": writer.id, "job": "run", "outcome": "done"}
    writer.event("session", told, t=9.0, wall=ENDED)
    writer.finish("done", None, None, ENDED)
    return writer.path


def fill(writer: SessionWriter) -> None:
    """Write a picture, a document, a row and an effect."""
    writer.frame("capture", b"\x89PNG not really")
    writer.document("calibration", {"rms_px": 0.1, "picture": "frames/capture.png"})
    writer.trajectory(dict.fromkeys(COMMANDED, 3))
    writer.effect({"n": 1, "effect": "ReadArm", "asked": {}})


def test_a_whole_record_is_sound(path: Path) -> None:
    """Nothing is found, and nothing is to be noted."""
    report = verify_record(path)
    assert report.ok
    assert report.findings == report.notes == ()
    assert report.id == path.name


@pytest.mark.parametrize(
    "place", ["calibration.json", "frames/capture.png", "trajectory.csv", "effects.jsonl"]
)
def test_each_file_is_vouched_for(path: Path, place: str) -> None:
    """One changed byte is found, and so is a file that is gone; the others stay sound."""
    content = (path / place).read_bytes()
    (path / place).write_bytes(content[:-2] + bytes([content[-2] ^ 1]) + content[-1:])
    assert verify_record(path).findings == (f"{place} is changed",)
    (path / place).unlink()
    assert verify_record(path).findings == (f"{place} is missing",)


def test_a_changed_line_comes_first_and_names_its_number(path: Path) -> None:
    """Lines that were swapped are out of order; the first of them is named."""
    (path / "trajectory.csv").unlink()
    lines = (path / "events.jsonl").read_bytes().splitlines(keepends=True)
    (path / "events.jsonl").write_bytes(b"".join([lines[1], lines[0], *lines[2:]]))
    findings = verify_record(path).findings
    assert findings[0].startswith("events.jsonl: line 1 is out of order: 2 stands")
    assert findings[1] == "trajectory.csv is missing"


@pytest.mark.parametrize(("name", "value"), [("outcome", "fault"), ("job", "home")])
def test_a_head_that_contradicts_the_lines_is_found(path: Path, name: str, value: str) -> None:
    """session.json has no hash of its own: the lines say what was asked and how it ended."""
    meta = read_object(path / "session.json") | {name: value}
    (path / "session.json").write_bytes(encode(meta))
    (finding,) = verify_record(path).findings
    assert finding.startswith(f"session.json: {name} is {value}")


def test_a_damaged_head_is_a_finding_and_no_error(path: Path) -> None:
    """Whatever cannot be read is told of this record, so that the others are looked at too."""
    (path / "session.json").write_bytes(b"{")
    report = verify_record(path)
    assert not report.ok
    assert "session.json is no JSON" in report.findings[0]


def test_a_record_that_was_broken_off_is_sound_up_to_its_tear(store: Store, begin: Begin) -> None:
    """Closed as interrupted it is sealed as it was found; the tear is noted."""
    writer = begin(3)
    fill(writer)
    with (writer.path / "events.jsonl").open("ab") as file:
        file.write(b'{"seq": 4, "torn')
    writer.close()
    assert "it has not ended" in verify_record(writer.path).notes[-1]
    store.close_interrupted(writer.id)
    report = verify_record(writer.path)
    assert report.ok
    assert any(note.startswith("torn: bytes follow line 3") for note in report.notes)
    (writer.path / "frames" / "capture.png").unlink()
    assert verify_record(writer.path).findings == ("frames/capture.png is missing",)


def test_without_a_seal_of_files_a_picture_that_a_document_names_is_missed(begin: Begin) -> None:
    """Of a session that runs, the calibration says which picture it was made from."""
    writer = begin(1)
    fill(writer)
    (writer.path / "frames" / "capture.png").unlink()
    (finding,) = verify_record(writer.path).findings
    assert finding.startswith("frames/capture.png is missing")
    writer.close()
