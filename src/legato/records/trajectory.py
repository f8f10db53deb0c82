"""trajectory.csv: one row for each motion command and reading, in the order they happened.

`t` is the cell's clock in s, the one that a simulated world's testimony counts in. Steps are
absolute half-steps, joints come from the read-back in rad, x y z in mm, robot base frame.
"""

import csv
import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOTORS = range(1, 7)
COMMANDED = tuple(f"commanded_{m}" for m in MOTORS)
READ = tuple(f"read_{m}" for m in MOTORS)
JOINTS = ("t1", "t2", "t3", "pitch", "roll")
PLACE = ("x", "y", "z")
COLUMNS = ("t", *COMMANDED, *READ, *JOINTS, *PLACE, "contact", "station_mm", "why")
DECIMALS = {"t": 4, **dict.fromkeys(JOINTS, 6), **dict.fromkeys(PLACE, 4)}


def trajectory_row(
    *,
    t: float,
    commanded: Sequence[int],
    read: Sequence[int],
    joints: Sequence[float],
    xyz: Sequence[float],
    contact: bool,
    station: float | None,
    why: str,
) -> dict[str, Any]:
    """Return one row by column; joints (5,) rad, xyz (3,) mm of the read-back."""
    return {
        "t": t,
        **dict(zip(COMMANDED, commanded, strict=True)),
        **dict(zip(READ, read, strict=True)),
        **dict(zip(JOINTS, joints, strict=True)),
        **dict(zip(PLACE, xyz, strict=True)),
        "contact": contact,
        "station_mm": station,
        "why": why,
    }


def row_line(row: Mapping[str, Any]) -> bytes:
    """Return a row as a line without its newline; raises ValueError for a column that is none."""
    unknown = set(row) - set(COLUMNS)
    if unknown:
        raise ValueError(f"a trajectory has no column {sorted(unknown)[0]!r}")
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(_cell(name, row.get(name)) for name in COLUMNS)
    return text.getvalue().encode()


def header_line() -> bytes:
    """Return the first line, without its newline."""
    return ",".join(COLUMNS).encode()


def _cell(name: str, value: Any) -> object:
    """Return one value as it stands in the file."""
    if value is None:
        return ""
    if name == "contact":
        return int(value)
    if name in DECIMALS:
        return f"{float(value):.{DECIMALS[name]}f}"
    return value


def parse(content: bytes) -> "dict[str, NDArray[Any]]":
    """Return columns (N,) by name up to the first row that is torn.

    Numbers are floats, NaN where a cell is empty; `contact` is bool, `why` is text.
    """
    import numpy as np

    rows = _whole_rows(content)
    columns: dict[str, NDArray[Any]] = {}
    for index, name in enumerate(COLUMNS):
        values = [row[index] for row in rows]
        if name == "why":
            columns[name] = np.array(values, dtype=str)
        else:
            numbers = np.array([float(v) if v else np.nan for v in values], dtype=float)
            columns[name] = numbers == 1.0 if name == "contact" else numbers
    return columns


def _whole_rows(content: bytes) -> list[list[str]]:
    """Return the rows under the header that are complete and made of numbers."""
    text = content.decode("utf-8", errors="replace")
    lines = text.split("\n")[:-1]  # what follows the last newline is torn or empty
    found = []
    for row in csv.reader(lines[1:]):
        if len(row) != len(COLUMNS) or not all(_is_number(cell) for cell in row[:-1]):
            break
        found.append(row)
    return found


def _is_number(cell: str) -> bool:
    try:
        float(cell or 0)
    except ValueError:
        return False
    return True
