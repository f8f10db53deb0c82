"""The chain of event lines finds what was changed, removed, moved or added."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from legato.records.chain import EVENTS, read_events, verify_chain
from legato.records.errors import RecordError
from legato.records.session import SessionWriter
from legato.records.store import Store

Begin = Callable[..., SessionWriter]
LINES = 6
ENDED = "2026-11-22T01:48:00+00:00"
many = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture
def sealed(begin: Begin) -> Path:
    """Return the events of a finished session of LINES lines."""
    writer = begin(LINES)
    writer.finish("done", None, None, ENDED)
    return writer.path / EVENTS


@pytest.fixture
def whole(sealed: Path) -> bytes:
    """Return the untouched content of `sealed`."""
    return sealed.read_bytes()


def test_a_finished_session_verifies(sealed: Path) -> None:
    """An untouched record is whole and its end is vouched for, by folder or by file."""
    for path in (sealed, sealed.parent):
        report = verify_chain(path)
        assert report.ok
        assert report.sealed
        assert not report.torn
        assert (report.lines, report.line) == (LINES, None)


@many
@given(data=st.data())
def test_any_changed_byte_is_found_in_its_line(
    sealed: Path, whole: bytes, data: st.DataObject
) -> None:
    """Whatever byte is changed to whatever else, the report names the line that it stands in."""
    at = data.draw(st.integers(0, len(whole) - 1))
    value = data.draw(st.integers(0, 255).filter(lambda v: v != whole[at]))
    sealed.write_bytes(whole[:at] + bytes([value]) + whole[at + 1 :])
    report = verify_chain(sealed)
    assert not report.ok
    assert report.line == whole[:at].count(b"\n") + 1


@many
@given(
    first=st.integers(0, LINES - 1), count=st.integers(1, LINES - 1), swap=st.integers(0, LINES - 2)
)
def test_removed_and_swapped_lines_are_found(
    sealed: Path, whole: bytes, first: int, count: int, swap: int
) -> None:
    """Lines taken out anywhere, the end included, or put in another order are named."""
    lines = whole.splitlines(keepends=True)
    sealed.write_bytes(b"".join(lines[:first] + lines[first + count :]))
    assert verify_chain(sealed).line == first + 1
    lines[swap], lines[swap + 1] = lines[swap + 1], lines[swap]
    sealed.write_bytes(b"".join(lines))
    assert verify_chain(sealed).line == swap + 1


def test_added_lines_are_found(sealed: Path, whole: bytes) -> None:
    """A line repeated within, or appended after the end, is named."""
    lines = whole.splitlines(keepends=True)
    sealed.write_bytes(b"".join([*lines[:3], lines[2], *lines[3:]]))
    assert verify_chain(sealed).line == 4
    sealed.write_bytes(whole + lines[-1])
    assert not verify_chain(sealed).ok


def test_a_running_session_verifies_without_a_seal(begin: Begin) -> None:
    """Before a session ends its lines verify, all but the last vouched for."""
    report = verify_chain(begin(3).path)
    assert report.ok
    assert not report.sealed
    assert "no end" in report.text


@many
@given(data=st.data())
def test_a_changed_byte_before_the_last_line_is_found_without_a_seal(
    begin: Begin, data: st.DataObject
) -> None:
    """Of a record that never ended, every line but the last is protected."""
    writer = begin(4)
    path = writer.path / EVENTS
    content = path.read_bytes()
    at = data.draw(st.integers(0, content[:-1].rindex(b"\n") - 1))
    path.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
    report = verify_chain(path)
    writer.close()
    assert not report.ok
    assert report.line == content[:at].count(b"\n") + 1


@many
@given(data=st.data())
def test_a_torn_tail_reads_up_to_the_tear(store: Store, begin: Begin, data: st.DataObject) -> None:
    """Cut off at any byte, a record gives every whole line and says that it is torn."""
    writer = begin(3)
    path = writer.path / EVENTS
    content = path.read_bytes()
    cut = data.draw(st.integers(0, len(content)))
    path.write_bytes(content[:cut])
    writer.close()
    events, torn = read_events(writer.path)
    assert [e["seq"] for e in events] == list(range(1, content[:cut].count(b"\n") + 1))
    assert torn == bool(content[:cut] and not content[:cut].endswith(b"\n"))
    store.close_interrupted(writer.id)
    report = verify_chain(path)
    assert report.ok
    assert report.sealed
    assert report.torn == torn


def test_a_hole_of_zeros_is_a_tear(begin: Begin) -> None:
    """What a power cut leaves in the middle ends the reading, not the reader."""
    path = begin(3).path / EVENTS
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + bytes(len(lines[1]) - 1) + b"\n" + lines[2])
    events, torn = read_events(path.parent)
    assert len(events) == 1
    assert torn


def test_a_folder_without_events_is_refused(tmp_path: Path) -> None:
    """What is no record is named, with what to give instead."""
    with pytest.raises(RecordError, match=r"events\.jsonl.*session's folder"):
        verify_chain(tmp_path)
