"""A session's record: what is written comes back, and a disk that fails harms nothing."""

import resource
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path

import numpy as np
import pytest

from legato.records.chain import EVENTS, verify_chain
from legato.records.errors import RecordError
from legato.records.record import read_session
from legato.records.session import SessionWriter
from legato.records.store import Store
from legato.records.trajectory import COLUMNS, parse, trajectory_row

Begin = Callable[..., SessionWriter]
ENDED = "2026-11-22T01:48:00+00:00"


class Colour(StrEnum):
    """An enumeration as the wire has them."""

    RED = "red"


@contextmanager
def disk_full_after(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond `size` bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def row(t: float, station: float | None = 7.0) -> dict[str, object]:
    """Return one row of a trajectory."""
    return trajectory_row(
        t=t,
        commanded=range(1, 7),
        read=range(2, 8),
        joints=[0.1, 0.2, 0.3, -1.5, 0.0],
        xyz=[100.0, -50.0, 40.1234],
        contact=t > 1,
        station=station,
        why="descend",
    )


def test_everything_written_is_read_back(store: Store, begin: Begin) -> None:
    """Events, documents, pictures and trajectory come back as they were given."""
    writer = begin(2)
    writer.document("calibration", {"world_from_object": np.eye(4), "rms_px": np.float64(0.5)})
    writer.document("truth.json", {"touches": [], "bad": float("nan"), "who": Colour.RED})
    assert writer.frame("capture", b"png") == "frames/capture.png"
    writer.trajectory(row(0.5))
    writer.trajectory(row(1.5, station=None))
    writer.event("fault", {"cause": Colour.RED, "xyz": np.arange(3.0)}, t=9.0, wall=ENDED)
    meta = writer.finish("fault", "broke", "limit", ENDED)
    record = store.read(writer.id)
    assert record.meta == meta
    assert (record.meta["id"], record.meta["outcome"]) == (writer.id, "fault")
    assert [e["kind"] for e in record.events] == ["state", "state", "fault"]
    assert record.of_kind("fault")[0]["data"] == {"cause": "red", "xyz": [0.0, 1.0, 2.0]}
    assert record.calibration == {"world_from_object": np.eye(4).tolist(), "rms_px": 0.5}
    assert record.truth == {"touches": [], "bad": None, "who": "red"}
    assert [f.name for f in record.frames] == ["capture.png"]
    assert set(record.trajectory) == set(COLUMNS)
    np.testing.assert_allclose(record.trajectory["z"], 40.1234)
    assert record.trajectory["contact"].tolist() == [False, True]
    assert np.isnan(record.trajectory["station_mm"]).tolist() == [False, True]
    assert record.trajectory["why"].tolist() == ["descend", "descend"]
    assert not record.torn
    assert not record.damage


def test_a_session_with_few_parts_reads(begin: Begin) -> None:
    """What a session never came to is None or empty."""
    record = read_session(begin(0).path)
    assert record.events == []
    assert record.calibration is None
    assert record.truth is None
    assert record.frames == []
    assert record.trajectory["t"].size == 0
    assert not record.finished


def test_a_damaged_document_is_named_and_left_out(begin: Begin) -> None:
    """A part that cannot be read leaves the rest readable and a sentence behind."""
    writer = begin(1)
    (writer.path / "calibration.json").write_bytes(b'{"half\xff')
    record = read_session(writer.path)
    assert record.calibration is None
    assert any("calibration.json" in text for text in record.damage)
    assert len(record.events) == 1


def test_a_linked_document_is_not_followed(begin: Begin, tmp_path: Path) -> None:
    """A link put in a document's or a picture's place is not read."""
    writer = begin(1)
    secret = tmp_path / "secret.json"
    secret.write_text('{"key": 1}')
    (writer.path / "truth.json").symlink_to(secret)
    (writer.path / "frames").mkdir()
    (writer.path / "frames" / "x.png").symlink_to(secret)
    record = read_session(writer.path)
    assert record.truth is None
    assert record.frames == []
    assert record.damage


def test_a_torn_trajectory_reads_up_to_the_tear(begin: Begin) -> None:
    """Half a row at the end is left out, and so is a row of junk with what follows it."""
    writer = begin(0)
    for t in (0.0, 1.0, 2.0):
        writer.trajectory(row(t))
    content = (writer.path / "trajectory.csv").read_bytes()
    assert parse(content[:-4])["t"].tolist() == [0.0, 1.0]
    assert parse(content.replace(b"1.0000,", b"junk,"))["t"].tolist() == [0.0]


def test_a_column_that_is_none_is_refused(begin: Begin) -> None:
    """A misspelt column is an error and not a silent gap."""
    with pytest.raises(ValueError, match="'speed'"):
        begin(0).trajectory({"t": 1.0, "speed": 2})


@pytest.mark.parametrize("name", ["../x", "a/b", "", ".hidden", "x" * 65, "a\x00b"])
def test_names_that_lead_elsewhere_are_refused(begin: Begin, name: str) -> None:
    """A picture or document cannot be put outside its session."""
    writer = begin(0)
    with pytest.raises(ValueError, match="names no part"):
        writer.frame(name, b"")
    with pytest.raises(ValueError, match="names no part"):
        writer.document(name, {})


def test_session_json_is_not_a_document(begin: Begin) -> None:
    """The outcome cannot be overwritten by a document of that name."""
    with pytest.raises(ValueError, match="finish alone"):
        begin(0).document("session", {})


def test_a_finished_session_takes_no_more(begin: Begin) -> None:
    """After the outcome there are no events, rows or second outcomes."""
    writer = begin(1)
    writer.finish("done", None, None, ENDED)
    with pytest.raises(RecordError, match="has ended"):
        writer.event("state", {}, t=0.0, wall=ENDED)
    with pytest.raises(RecordError, match="has ended"):
        writer.trajectory(row(0.0))
    with pytest.raises(RecordError, match="has ended"):
        writer.finish("fault", None, None, ENDED)
    assert verify_chain(writer.path).ok


def test_a_full_disk_leaves_no_half_line(begin: Begin) -> None:
    """A line that does not fit is taken back, the error says what to do, and later lines go on."""
    writer = begin(3)
    size = (writer.path / EVENTS).stat().st_size
    with disk_full_after(size + 20):
        with pytest.raises(RecordError, match=r"events\.jsonl.*free space"):
            writer.event("state", {"state": "idle"}, t=1.0, wall=ENDED)
        with pytest.raises(RecordError, match="free space"):
            writer.document("calibration", {"long": "x" * 5000})
    assert not (writer.path / "calibration.json").exists()
    assert writer.event("state", {"state": "idle"}, t=2.0, wall=ENDED, durable=True) == 4
    writer.finish("done", None, None, ENDED)
    assert verify_chain(writer.path).lines == 4
    assert verify_chain(writer.path).ok


def test_finishing_may_be_tried_again(store: Store, begin: Begin) -> None:
    """An outcome that the disk did not take can be given once there is room."""
    writer = begin(3)
    with disk_full_after(10), pytest.raises(RecordError, match=r"session\.json"):
        writer.finish("done", None, None, ENDED)
    assert store.unfinished() == [writer.id]
    writer.finish("done", None, None, ENDED)
    assert store.read(writer.id).meta["outcome"] == "done"


def test_threads_write_one_chain(begin: Begin) -> None:
    """Events from several threads stand one after the other in a sound chain."""
    writer = begin(0)

    def write() -> None:
        for n in range(50):
            writer.event("progress", {"n": n}, t=float(n), wall=ENDED)

    threads = [threading.Thread(target=write) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    writer.finish("done", None, None, ENDED)
    report = verify_chain(writer.path)
    assert report.ok
    assert report.lines == 200
