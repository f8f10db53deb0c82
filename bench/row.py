"""One figure, what it is held against, and whether it holds."""

import json
import platform
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

RESULTS = Path(__file__).resolve().parent.parent / "docs" / "bench"


@dataclass(frozen=True)
class Row:
    """A figure with its unit; `limit` is the aim, `peer` a floor or rival of the same run."""

    name: str
    value: float
    unit: str
    limit: float | None = None
    at_least: bool = False
    peer: float | None = None
    note: str = ""

    @property
    def holds(self) -> bool | None:
        """Whether the aim is met; None where there is none."""
        if self.limit is None:
            return None
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    def line(self) -> str:
        """Return the row for people."""
        verdict = {None: "    ", True: "ok  ", False: "FAIL"}[self.holds]
        sign = ">=" if self.at_least else "<="
        aim = f"  {sign} {self.limit:g}" if self.limit is not None else ""
        peer = f"  ({self.value / self.peer:.2f} x {self.peer:.4g})" if self.peer else ""
        note = f"  {self.note}" if self.note else ""
        return f"{verdict} {self.name:<52} {self.value:10.4g} {self.unit:<5}{aim}{peer}{note}"


def keep(name: str, rows: Iterable[Row], **more: object) -> Path:
    """Write rows, and what else belongs to them, to docs/bench/NAME.json."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    path = RESULTS / f"{name}.json"
    document = {
        "command": f"python -m bench {name}",
        "python": platform.python_version(),
        "rows": [asdict(r) | {"holds": r.holds} for r in rows],
        **more,
    }
    text = json.dumps(document, indent=1, default=lambda number: number.item())  # numpy's own
    path.write_text(text + "\n", encoding="utf-8")
    return path
