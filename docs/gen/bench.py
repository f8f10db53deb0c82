"""The benches' figures as a page, from docs/bench/*.json."""

import json
from pathlib import Path
from typing import Any

from docs.gen.tables import plain, table

BENCH = Path(__file__).resolve().parents[1] / "bench"
HEAD = """\
# Figures measured

What `make bench` found, one section a bench, as it was kept in `docs/bench/`. A figure with an aim
is held to it. Times are of a shared machine of two cores.
"""


def page() -> str:
    """Return the page."""
    parts = [HEAD]
    for path in sorted(BENCH.glob("*.json")):
        document = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(document, dict) or not document.get("rows"):
            continue
        parts.append(f"## {path.stem}\n\n`{document.get('command', path.stem)}`\n")
        rows = (_row(row, path.stem) for row in document["rows"])
        parts.append(table(("figure", "value", "aim", "holds"), rows))
    return "\n".join(parts)


def _row(row: dict[str, Any], bench: str) -> tuple[str, str, str, str]:
    unit = row.get("unit") or ""
    aim = ""
    if row.get("limit") is not None:
        aim = f"{'≥' if row.get('at_least') else '≤'} {_figure(row['limit'])} {unit}".strip()
    holds = {True: "yes", False: "**no**"}.get(row.get("holds"), "")  # type: ignore[arg-type]
    name = str(row["name"]).removeprefix(f"{bench}: ")
    text = plain(name) + (f"<br>*{plain(row['note'])}*" if row.get("note") else "")
    return text, f"{_figure(row['value'])} {unit}".strip(), aim, holds


def _figure(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, int | float) else str(value)
