"""Sessions side by side as one HTML file that needs nothing else."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from legato.records.errors import told as told_error
from legato.records.files import make_folder, replace_file
from legato.records.record import SessionRecord
from legato.report import facts
from legato.report.compare import Comparison, Side, compare
from legato.report.figures import campaign
from legato.report.html import environment, number, shown_day

TEMPLATE = "compare.html.j2"
Figures = list[tuple[str, str]]  # names and text
PLACED = ("leg from", "turn from")
SIDE_BY_SIDE = 4  # with more sessions than these each has a row instead of a column


def write_comparison(records: Sequence[SessionRecord], path: Path) -> Comparison:
    """Write the page of several sessions and return what it says.

    Raises ValueError for fewer than two, RecordError where the file cannot be written.
    """
    found = compare(records)
    page = environment().get_template(TEMPLATE).render(**content(found, records))
    make_folder(path.parent)
    with told_error("write", path):
        replace_file(path, page.encode())
    return found


def content(found: Comparison, records: Sequence[SessionRecord]) -> dict[str, Any]:
    """Return everything that the template shows, by name."""
    columns = len(found.sides) <= SIDE_BY_SIDE
    rows, alike = (side_rows(found), []) if columns else apart(side_rows(found))
    # Poses of many sessions have a table of their own, beside their figure.
    placed = [] if columns else [[f for f in row if f[0].startswith(PLACED)] for row in rows]
    rows = rows if columns else [[f for f in row if not f[0].startswith(PLACED)] for row in rows]
    return {
        "found": found,
        "tones": [facts.headline(record)["tone"] for record in records],
        "flaws": [(s.number, text) for s, r in zip(found.sides, records, strict=True)
                  for text in facts.warnings(r)],
        "names": [name for name, _ in rows[0]],
        "rows": [[value for _, value in row] for row in rows],
        "alike": alike,
        "placed_names": [name for name, _ in placed[0]] if placed else [],
        "placed": [[value for _, value in row] for row in placed],
        "columns": columns,
        "contacts": campaign.contacts(found),
        "poses": campaign.poses(found),
        "quality": campaign.quality(found),
        "durations": campaign.durations(found),
    }  # fmt: skip


def side_rows(found: Comparison) -> list[Figures]:
    """Return every session's figures."""
    return [figures(side) for side in found.sides]


def apart(rows: list[Figures]) -> tuple[list[Figures], Figures]:
    """Return the figures that differ between sessions, and those that are the same in all."""
    same = [len({row[i][1] for row in rows}) == 1 for i in range(len(rows[0]))]
    alike = [figure for figure, equal in zip(rows[0], same, strict=True) if equal]
    return [[f for f, equal in zip(row, same, strict=True) if not equal] for row in rows], alike


def figures(side: Side) -> Figures:
    """Return a session's figures as names and text."""
    shift = side.pose.shift_mm if side.pose else (None,) * 3
    turn = side.pose.turn_deg if side.pose else (None,) * 3
    return [
        ("session", side.id),
        ("job", side.job),
        ("outcome", side.outcome or "none yet"),
        ("cell", side.cell),
        ("began", shown_day(side.started) if side.started else number(None)),
        ("seconds by the wall", number(side.seconds, 1)),
        ("engine", side.engine or number(None)),
        ("residual rms px", number(side.rms_px, 3)),
        ("worst station 1 \N{GREEK SMALL LETTER SIGMA} mm", number(side.sigma_mm, 3)),
        ("strokes with contact", str(side.strokes)),
        ("mean contact mm", number(side.contact_mm, 3, sign=True)),
        ("worst error, true mm", number(side.error_mm, 3)),
        ("leg from the mean, x y z mm", " ".join(number(v, 3, sign=True) for v in shift)),
        ("turn from the mean, x y z deg", " ".join(number(v, 4, sign=True) for v in turn)),
    ]
