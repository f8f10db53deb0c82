"""A session as tables for notebooks: trajectory, events and contacts, as CSV or Parquet files.

House units, as the records have them: mm, rad, s. Each row has both clocks: `wall_ns`, the time of
day as ns since 1970, and `cell_s`, the cell's clock, which the records call t and which a simulated
cell may run faster. What a table has no value for is empty.
"""

import csv
import io
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from legato.export.clock import time_line
from legato.records.files import make_folder, replace_file
from legato.records.record import SessionRecord
from legato.records.trajectory import COLUMNS

Table = dict[str, list[Any]]
AXES, CELL = "xyz", "cell_s"


class NeedsLibrary(RuntimeError):
    """A library that a format needs is not installed."""


def write_csv(record: SessionRecord, folder: Path) -> list[Path]:
    """Write the tables as CSV files into a folder; returns their paths."""
    return list(_written(record, folder, "csv", _csv))


def write_parquet(record: SessionRecord, folder: Path) -> list[Path]:
    """Write the tables as Parquet files into a folder, session.json in their metadata.

    Raises NeedsLibrary without pyarrow.
    """
    try:
        import pyarrow  # noqa: F401  # seen to be there before a file is written
    except ModuleNotFoundError as error:
        raise NeedsLibrary("Parquet needs pyarrow: install legato[parquet]") from error
    meta = json.dumps(record.meta).encode()
    return list(_written(record, folder, "parquet", lambda table: _parquet(table, meta)))


def tables(record: SessionRecord) -> dict[str, Table]:
    """Return the tables by name, each as columns of one length."""
    return {"trajectory": trajectory(record), "events": events(record),
            "contacts": contacts(record)}  # fmt: skip


def trajectory(record: SessionRecord) -> Table:
    """Return trajectory.csv's columns with the time of each row."""
    line, path = time_line(record), record.trajectory
    columns: Table = {"wall_ns": [line.at(t) for t in path["t"]]}
    rest = {CELL if n == "t" else n: [_plain(v) for v in path[n]] for n in COLUMNS}
    return columns | rest


def events(record: SessionRecord) -> Table:
    """Return every event, its data as JSON text."""
    line = time_line(record)
    rows = [
        {"wall_ns": line.at(e["t"]), CELL: e["t"], "seq": e["seq"], "wall": e["wall"],
         "kind": e["kind"], "data": json.dumps(e.get("data"), ensure_ascii=False)}
        for e in record.events
    ]  # fmt: skip
    return _columns(rows, ("wall_ns", CELL, "seq", "wall", "kind", "data"))


def contacts(record: SessionRecord) -> Table:
    """Return every contact: where it was predicted and where it was touched, with what is sure."""
    line = time_line(record)
    sigma = {
        s["station_mm"]: s.get("sigma_mm") for s in (record.calibration or {}).get("stations") or ()
    }
    plain = ("station_mm", "stroke", "contact_mm", "place_mm", "across_mm")
    places = {"xyz_mm": "touched", "predicted_xyz_mm": "predicted"}
    rows = []
    for event in record.of_kind("contact"):
        data = event["data"]
        row = {"wall_ns": line.at(event["t"]), CELL: event["t"], **{k: data.get(k) for k in plain}}
        row["sigma_mm"] = sigma.get(data.get("station_mm"))
        for key, name in places.items():
            row |= dict(zip((f"{name}_{a}_mm" for a in AXES), data.get(key) or (), strict=False))
        rows.append(row)
    named = [f"{name}_{a}_mm" for name in places.values() for a in AXES]
    return _columns(rows, ("wall_ns", CELL, *plain, "sigma_mm", *named))


def _columns(rows: list[dict[str, Any]], names: tuple[str, ...]) -> Table:
    """Return rows as columns."""
    return {name: [row.get(name) for row in rows] for name in names}


def _plain(value: Any) -> Any:
    """Return a cell as Python's own, None where it is no number."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _written(
    record: SessionRecord, folder: Path, ending: str, encode: Callable[[Table], bytes]
) -> Iterator[Path]:
    """Write each table as a file and yield its path."""
    make_folder(folder)
    for name, table in tables(record).items():
        path = folder / f"{name}.{ending}"
        replace_file(path, encode(table))
        yield path


def _csv(table: Table) -> bytes:
    """Return a table as CSV: commas, one line of names, UTF-8."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(zip(*table.values(), strict=True))
    return text.getvalue().encode()


def _parquet(table: Table, meta: bytes) -> bytes:
    """Return a table as Parquet with the session's own words in its metadata."""
    import pyarrow
    from pyarrow import parquet

    content = pyarrow.table(table)
    content = content.replace_schema_metadata({b"legato.session": meta})
    out = pyarrow.BufferOutputStream()
    parquet.write_table(content, out)
    return bytes(out.getvalue())
