"""The reference page: it is what the daemon answers, and it is up to date."""

from pathlib import Path

from legato.config.load import load, shipped
from legato.control.table import METHODS
from legato.daemon.reference import reference

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "table.md"


def test_the_page_is_up_to_date() -> None:
    """Whoever changes the wire makes the page anew."""
    stations = load(shipped("sim.toml"), need_intrinsics=False).config.leg.stations_mm
    assert PAGE.read_text(encoding="utf-8") == reference(stations), (
        "run: python -m legato.daemon.reference > docs/reference/table.md"
    )


def test_every_method_has_its_line_in_both_tables() -> None:
    """Nothing that can be asked is missing from the page."""
    lines = reference((7.0, 67.0)).splitlines()
    for method in METHODS:
        assert sum(line.startswith(f"| `{method}` |") for line in lines) >= 2, method
    assert len([line for line in lines if line.startswith("| `estop` |")]) == 3
