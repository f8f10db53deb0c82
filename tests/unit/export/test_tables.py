"""Tables for notebooks: what the record says, in CSV and Parquet alike."""

import csv
import json
import sys
from pathlib import Path

import pytest
from pyarrow import parquet

from legato.export.clock import nanoseconds
from legato.export.tables import NeedsLibrary, tables, write_csv, write_parquet
from legato.records.record import SessionRecord


def test_tables_hold_the_record(whole: SessionRecord) -> None:
    """A row for each motion, event and contact; events keep their data whole."""
    found = tables(whole)
    assert len(found["trajectory"]["t"]) == whole.trajectory["t"].size
    assert [json.loads(d) for d in found["events"]["data"]] == [e["data"] for e in whole.events]
    contacts = [e["data"] for e in whole.of_kind("contact")]
    assert found["contacts"]["contact_mm"] == [c["contact_mm"] for c in contacts]
    assert found["contacts"]["touched_z_mm"] == [c["xyz_mm"][2] for c in contacts]
    assert found["contacts"]["sigma_mm"][0] == pytest.approx(0.08 + 7.0 / 2000.0)


def test_csv_and_parquet_agree(whole: SessionRecord, tmp_path: Path) -> None:
    """Both have the same tables, rows and numbers; empty cells are empty in both."""
    plain = {p.stem: p for p in write_csv(whole, tmp_path)}
    packed = {p.stem: p for p in write_parquet(whole, tmp_path)}
    assert list(plain) == list(packed) == ["trajectory", "events", "contacts"]
    for name, path in plain.items():
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
        table = parquet.read_table(packed[name])
        assert table.column_names == list(rows[0])
        for row, other in zip(rows, table.to_pylist(), strict=True):
            assert row == {k: "" if v is None else str(v) for k, v in other.items()}
    meta = parquet.read_schema(packed["events"]).metadata[b"legato.session"]
    assert json.loads(meta)["id"] == whole.id


def test_a_broken_session_gives_tables_without_rows(
    broken_off: SessionRecord, tmp_path: Path
) -> None:
    """What a session never came to is a table with its columns and no rows."""
    found = {p.stem: p.read_text().splitlines() for p in write_csv(broken_off, tmp_path)}
    assert len(found["contacts"]) == len(found["trajectory"]) == 1
    assert len(found["events"]) == 1 + len(broken_off.events)
    assert all(p.exists() for p in write_parquet(broken_off, tmp_path))


def test_without_pyarrow_parquet_says_what_to_install(
    whole: SessionRecord, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The error names the extra, and no file is left behind."""
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(NeedsLibrary, match=r"legato\[parquet\]"):
        write_parquet(whole, tmp_path / "tables")
    assert not (tmp_path / "tables").exists()


@pytest.mark.parametrize(
    ("wall", "expected"),
    [("1970-01-01T00:00:01.000001+00:00", 1_000_001_000), ("1970-01-01T00:00:02", 2_000_000_000),
     ("1970-01-01T01:00:00+01:00", 0), ("gone", 0), (None, 0)],
)  # fmt: skip
def test_wall_times_become_whole_nanoseconds(wall: str | None, expected: int) -> None:
    """Exact to the microsecond, UTC where no zone is told, 0 where there is no time."""
    assert nanoseconds(wall) == expected
