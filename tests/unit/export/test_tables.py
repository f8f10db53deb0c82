"""Tables for notebooks: what the record says, in CSV and Parquet alike."""

import csv
import json
import sys
from pathlib import Path

import pytest
from pyarrow import parquet

from legato.export.clock import NANO, nanoseconds, time_line
from legato.export.tables import NeedsLibrary, tables, write_csv, write_parquet
from legato.records.record import SessionRecord
from tests.unit.export.conftest import PACE


def test_tables_hold_the_record(whole: SessionRecord) -> None:
    """A row for each motion, event and contact; events keep their data whole."""
    found = tables(whole)
    assert found["trajectory"]["cell_s"] == whole.trajectory["t"].tolist()
    assert [json.loads(d) for d in found["events"]["data"]] == [e["data"] for e in whole.events]
    contacts = [e["data"] for e in whole.of_kind("contact")]
    assert found["contacts"]["contact_mm"] == [c["contact_mm"] for c in contacts]
    assert found["contacts"]["touched_z_mm"] == [c["xyz_mm"][2] for c in contacts]
    assert found["contacts"]["sigma_mm"][0] == pytest.approx(0.08 + 7.0 / 2000.0)


def test_wall_times_are_the_walls_and_the_cells_clock_stands_beside(
    hasty: SessionRecord,
) -> None:
    """At whatever pace the cell's clock runs, an event's wall_ns is its own wall time; cell_s is t.

    A row between two events lies between them by both clocks.
    """
    found = tables(hasty)
    events, moves, touched = (found[n] for n in ("events", "trajectory", "contacts"))
    assert events["wall_ns"] == [nanoseconds(e["wall"]) for e in hasty.events]
    assert events["cell_s"] == [e["t"] for e in hasty.events]
    contacts = hasty.of_kind("contact")
    assert touched["wall_ns"] == [nanoseconds(e["wall"]) for e in contacts]
    assert touched["cell_s"] == [e["t"] for e in contacts]
    wall_s = (moves["wall_ns"][-1] - moves["wall_ns"][0]) / NANO
    cell_s = moves["cell_s"][-1] - moves["cell_s"][0]
    assert wall_s * PACE == pytest.approx(cell_s, rel=1e-4)
    assert events["wall_ns"][0] < moves["wall_ns"][0] < moves["wall_ns"][-1]
    assert moves["wall_ns"][-1] <= events["wall_ns"][-1] + NANO // 1000  # its times are rounded


def test_beyond_the_events_the_cells_clock_counts_at_its_pace(hasty: SessionRecord) -> None:
    """Before the first and after the last event; where the wall's clock was set back, it was.

    An event whose wall time cannot be read is passed over.
    """
    walls = {10.0: "00:01:00", 20.0: "gone", 30.0: "00:01:01", 50.0: "00:00:59"}
    events = [{"t": t, "wall": f"1970-01-01T{wall}"} for t, wall in walls.items()]
    line = time_line(SessionRecord(hasty.path, hasty.meta, events, torn=False))
    seconds = (-10.0, 10.0, 20.0, 30.0, 40.0, 50.0, 90.0)
    assert [line.at(s) / NANO for s in seconds] == [59.0, 60.0, 60.5, 61.0, 60.0, 59.0, 61.0]
    bare = SessionRecord(hasty.path, {"started": "1970-01-01T00:00:05"}, events[1:2], torn=False)
    assert [time_line(bare).at(s) / NANO for s in (20.0, 22.0)] == [5.0, 7.0]


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
