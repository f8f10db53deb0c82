"""The report as PDF: what the page says, on paper; hostile records are text and nothing else."""

import html
import io
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from pypdf import PdfReader

from legato.records.record import SessionRecord, read_session
from legato.report.html import content
from legato.report.pdf import NeedsTypst, literal, moment, source, typeset, write_pdf
from tests.unit.report.sessions import STATIONS, begun

HOSTILE = 'a "#panic(1)" \\ $x$ *b* [c] <d> `e` @f // {{ g }}'


@pytest.fixture(scope="module")
def shown(whole_path: Path) -> dict[str, Any]:
    """Return what the report of a whole session shows."""
    return content(read_session(whole_path))


@pytest.fixture(scope="module")
def paper(shown: dict[str, Any]) -> bytes:
    """Return it as PDF."""
    return typeset(shown)


@pytest.fixture(scope="module")
def words(paper: bytes) -> list[str]:
    """Return the text of each of its pages."""
    return pages(paper)


def pages(pdf: bytes) -> list[str]:
    """Return the text of each page, spaces as they fall."""
    return [" ".join(page.extract_text().split()) for page in PdfReader(io.BytesIO(pdf)).pages]


def test_it_says_what_the_page_says(
    words: list[str], shown: dict[str, Any], whole_page: str
) -> None:
    """Every heading and every figure of the HTML page stands in the PDF, in the same order."""
    text = " ".join(words)
    headings = re.findall(r"<h[23]>([^<]+)</h[23]>", whole_page)
    assert len(headings) >= 12
    for heading in headings:
        assert heading in text
    markup = source(shown)
    described = re.findall(r'<img src="data:image/svg[^"]*" alt="([^"]+)"', whole_page)
    assert len(described) >= 8
    places = [markup.index(f'"{html.unescape(alt)}"') for alt in described]
    assert places == sorted(places)


def test_numbers_are_the_records(words: list[str], whole: SessionRecord) -> None:
    """Contacts, residuals and the configuration's hash stand in the text."""
    text = " ".join(words)
    solved = whole.calibration or {}
    assert f"{solved['rms_px']:.3f}" in text
    assert str(whole.meta["config_hash"]) in text
    for event in whole.of_kind("contact"):
        assert f"{event['data']['xyz_mm'][2]:.2f}" in text
    for station in STATIONS:
        assert f"massage_{station:g}" in text


def test_each_page_says_that_it_was_simulated_and_which_it_is(words: list[str]) -> None:
    """A page that comes loose still tells what it is."""
    for number, text in enumerate(words, start=1):
        assert "SIMULATED" in text
        assert f"{number} / {len(words)}" in text


def test_it_is_small_and_the_same_each_time(paper: bytes, shown: dict[str, Any]) -> None:
    """Under 3 MB; the same content gives the same bytes."""
    assert len(paper) < 3_000_000
    assert typeset(shown) == paper


def test_a_crashed_session_says_so_on_top_and_hostile_text_is_text(tmp_path: Path) -> None:
    """What a record holds is never markup; the tear and the fault stand on the first page."""
    cell = begun(tmp_path)
    cell.enter("capture", "idle")
    cell.event("fault", cause="camera_lost", text=HOSTILE, hint=HOSTILE, evidence={HOSTILE: [1]})
    path = cell.writer.path
    with (path / "events.jsonl").open("ab") as file:
        file.write(b'{"torn')
    record = read_session(path)
    record.meta["config"] = {"sim": {HOSTILE: HOSTILE}}
    file_written = write_pdf(record)
    assert file_written == path / "report.pdf"
    first = pages(file_written.read_bytes())[0]
    assert first.index("This record is torn") < first.index("What was asked")
    assert "camera_lost" in first
    bare = HOSTILE.replace(" ", "")
    assert first.replace(" ", "").count(bare) >= 3


@pytest.mark.parametrize(
    ("value", "expected"),
    [('a"b\\', '"a\\"b\\\\"'), ("x\x00\x1by\nz", '"xy\nz"'), (True, "true"), (0.25, "0.250000")],
)
def test_literals_are_typsts(value: object, expected: str) -> None:
    """Quotes and backslashes are escaped, control characters go, numbers are plain."""
    assert literal(value) == expected


def test_the_date_is_the_records() -> None:
    """A record that tells no time still gives a page, of the first second."""
    assert moment({"ended": None, "started": "2026-11-22T01:47:00.5"}).isoformat() == (
        "2026-11-22T01:47:00+00:00"
    )
    assert moment({"ended": "gone"}).year == 1970


def test_without_the_typesetter_it_says_what_to_install(
    shown: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error names the extra."""
    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(NeedsTypst, match=r"legato\[pdf\]"):
        typeset(shown)
