"""A whole record is held to its seal: whatever file is changed, lost or added is named."""

from pathlib import Path

import pytest

from legato.records.files import encode, read_object
from legato.records.head import head_digest
from legato.records.session import SessionWriter
from legato.records.store import Store
from legato.records.trajectory import COMMANDED
from legato.records.whole import verify_record
from tests.unit.records.conftest import STARTED, Begin

ENDED = "2026-11-22T02:00:00+00:00"


@pytest.fixture
def path(begin: Begin) -> Path:
    """Return the folder of a finished session with every kind of file."""
    writer = begin(2)
    asked = {"id": writer.id, "job": "run", "outcome": None}
    writer.event("session", asked, t=0.0, wall=STARTED)
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
    """The lines say what was asked and how it ended: this comes before that a hash is another."""
    meta = read_object(path / "session.json") | {name: value}
    (path / "session.json").write_bytes(encode(meta))
    first, *others = verify_record(path).findings
    assert first.startswith(f"session.json: {name} is {value}")
    assert all("another hash" in text for text in others)
    assert others


@pytest.mark.parametrize("end", ["finished", "interrupted", "running"])
def test_every_changed_byte_of_the_head_is_found(
    path: Path, store: Store, begin: Begin, end: str
) -> None:
    """Configuration, who asked, times, reason, the seal itself: whichever, and however it ended."""
    if end != "finished":
        writer = begin(1)
        writer.event("session", {"id": writer.id, "job": "run"}, t=0.0, wall=STARTED)
        fill(writer)
        writer.close()
        path = writer.path
    if end == "interrupted":
        store.close_interrupted(path.name)
    assert verify_record(path).ok
    head = path / "session.json"
    content = head.read_bytes()
    for at in range(len(content)):
        head.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
        assert not verify_record(path).ok, (at, content[at - 20 : at + 20])


def test_a_head_with_a_seal_of_its_own_is_contradicted_by_the_lines(path: Path) -> None:
    """Who writes another configuration and the hash to it has not changed the first line."""
    meta = read_object(path / "session.json") | {"params": {"picks": {}}}
    meta["seal"]["head"] = head_digest(meta)
    (path / "session.json").write_bytes(encode(meta) + b"\n")
    assert verify_record(path).findings == (
        "session.json is changed: its first line has another hash",
    )
    del meta["seal"]
    (path / "session.json").write_bytes(encode(meta) + b"\n")
    assert "session.json is changed: it tells of an end and has no seal" in (
        verify_record(path).findings
    )


def test_an_added_file_is_named_and_a_report_is_none(path: Path) -> None:
    """Wherever it lies and whatever it is; what is made of a record later may lie beside it."""
    (path / "report.html").write_text("made later")
    assert verify_record(path).ok
    (path / "frames" / "other.png").write_bytes(b"other")
    (path / "more").mkdir()
    (path / "more" / ".hidden").write_bytes(b"")
    (path / "link").symlink_to("/")
    assert verify_record(path).findings == tuple(
        f"{place} was added after the record had ended"
        for place in ("frames/other.png", "link", "more/.hidden")
    )


def test_a_record_of_an_earlier_version_is_held_to_what_it_has(begin: Begin) -> None:
    """No digest of its head, none is missed; files and lines are held to their hashes."""
    writer = begin(2)
    fill(writer)
    meta = writer.finish("done", None, None, ENDED)
    del meta["seal"]["head"]
    (writer.path / "session.json").write_bytes(encode(meta) + b"\n")
    assert verify_record(writer.path).ok
    (writer.path / "effects.jsonl").unlink()
    assert verify_record(writer.path).findings == ("effects.jsonl is missing",)


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
