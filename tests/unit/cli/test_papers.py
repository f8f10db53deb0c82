"""`legato report`, `compare` and `export` on records of the disk."""

import json
import shutil
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader

from legato.cli.exits import Exit
from tests.unit.cli.samples import document, run, write_cell
from tests.unit.report.sessions import whole_session


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a state folder with a session and a later copy of it."""
    folder = tmp_path_factory.mktemp("papers")
    path = whole_session(folder)
    later = path.with_name(path.name.replace("T0147", "T0148"))
    shutil.copytree(path, later)
    meta = json.loads((later / "session.json").read_text())
    meta |= {"id": later.name, "started": meta["started"].replace("T01:47", "T01:48")}
    (later / "session.json").write_text(json.dumps(meta))
    return folder


def ids(records: Path) -> list[str]:
    """Return the sessions, oldest first."""
    return sorted(p.name for p in (records / "sessions").iterdir())


def test_report_writes_pages_and_pdfs_of_the_latest_or_the_named(
    records: Path, tmp_path: Path
) -> None:
    """HTML into the session's folder by default, PDF where it is asked for."""
    told = document(run("report", "--state-dir", records, "--json"))
    assert told["session"] == ids(records)[-1]
    assert Path(told["report"]).read_bytes().startswith(b"<!doctype html>")
    paper = tmp_path / "r.pdf"
    result = run("report", ids(records)[0], "--pdf", "-o", paper, "--state-dir", records)
    assert result.stdout == f"{paper}\n"
    assert paper.read_bytes().startswith(b"%PDF")


def test_report_names_what_to_install_for_a_pdf(
    records: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the typesetter the command fails in one line, with what to do."""
    monkeypatch.setitem(sys.modules, "typst", None)
    result = run("report", "--pdf", "--state-dir", records)
    assert result.exit_code == Exit.FAILED
    assert "pip install 'legato[pdf]'" in result.stderr


def test_export_writes_each_format(records: Path, tmp_path: Path) -> None:
    """One file, or a folder of tables; the names are told."""
    file = tmp_path / "s.mcap"
    told = document(run("export", "-o", file, "--state-dir", records, "--json"))
    assert told == {"session": ids(records)[-1], "format": "mcap", "files": [str(file)]}
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    for form in ("csv", "parquet"):
        out = tmp_path / form
        told = document(run("export", ids(records)[0], "--format", form, "-o", out,
                            "--state-dir", records, "--json"))  # fmt: skip
        names = [Path(f).name for f in told["files"]]
        assert names == [f"{n}.{form}" for n in ("trajectory", "events", "contacts")]
        assert all(Path(f).stat().st_size for f in told["files"])


def test_export_writes_the_arm_of_the_configuration_or_of_a_session(
    records: Path, tmp_path: Path
) -> None:
    """A URDF needs no session; of a session it is the arm in its record."""
    cell = write_cell(tmp_path, "[robot]\nupper_arm_mm = 180.0\n")
    out = tmp_path / "arm.urdf"
    assert run("export", "--format", "urdf", "--config", cell, "-o", out).exit_code == 0
    assert 'xyz="0.18 0.0 0.0"' in out.read_text()
    run("export", ids(records)[0], "--format", "urdf", "-o", out, "--state-dir", records)
    assert 'xyz="0.17780000000000001 0.0 0.0"' in out.read_text() or "0.1778" in out.read_text()


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("export", "-o", "gone/s.mcap"), Exit.USAGE, "there is no folder gone"),
        (("export", "--format", "csv", "-o", "{file}"), Exit.USAGE, "is a file"),
        (("export", "20200101T000000Z-0000"), Exit.FAILED, "there is no session"),
        (("compare",), Exit.USAGE, "two or more"),
        (("compare", "--last", "2", "--job", "home"), Exit.USAGE, "two or more"),
        (("compare", "--job", "run"), Exit.USAGE, "--job goes with --last"),
        (("compare", "a", "b", "--last", "2"), Exit.USAGE, "not both"),
    ],
)
def test_what_cannot_be_done_is_said(
    records: Path, tmp_path: Path, words: tuple[str, ...], code: Exit, said: str
) -> None:
    """Each with its code and what to do; nothing is written."""
    (tmp_path / "file").touch()
    given = [w.replace("{file}", str(tmp_path / "file")) for w in words]
    result = run(*given, "--state-dir", records)
    assert result.exit_code == code
    assert said in result.stderr


def test_an_empty_store_says_how_to_fill_it(tmp_path: Path) -> None:
    """Where there is no session, the command says how to make one."""
    for words in (("report",), ("export",)):
        result = run(*words, "--state-dir", tmp_path)
        assert result.exit_code == Exit.FAILED
        assert "legato demo" in result.stderr


def test_compare_shows_tables_and_writes_a_page(records: Path, tmp_path: Path) -> None:
    """The latest so many, oldest first; tables for people, everything in the document."""
    page = tmp_path / "c.html"
    words = ("compare", "--last", "2", "--job", "run", "-o", page, "--state-dir", records)
    shown = run(*words).stdout
    assert shown.index(ids(records)[0]) < shown.index(ids(records)[1])
    assert "between sessions sd mm" in shown
    told = document(run(*words, "--json"))
    assert [s["id"] for s in told["sides"]] == ids(records)
    assert told["report"] == str(page)
    assert page.stat().st_size < 3_000_000
