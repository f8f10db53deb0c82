"""A sample of the machine that does anything at any moment; `python -m bench machine` has more."""

from pathlib import Path

from tests.system.attacked import SHORT, attacked
from tests.system.emulated import Cell
from tests.system.machine import let_loose
from tests.system.test_survive_line import TABLES
from tests.system.ward import LINE_FAULTS, SIM_FAULTS, Ward


def test_anything_at_any_moment_in_process(tmp_path: Path) -> None:
    """Devices that go wrong by lot, an arm in the daemon's own memory: every invariant holds."""
    with attacked(tmp_path, SHORT, time_scale=400.0, faults=SIM_FAULTS) as cell:
        ward = Ward(cell)
        let_loose(ward, 3, 32)
        assert ward.steps >= 60


def test_anything_at_any_moment_over_the_line(tmp_path: Path) -> None:
    """An arm on a pseudo-terminal: no motion byte outside a motion state, by the line's record."""
    emulator = Cell(tmp_path, *LINE_FAULTS, tables=TABLES)
    try:
        with attacked(tmp_path, TABLES) as cell:
            ward = Ward(cell, emulator)
            let_loose(ward, 2, 34)
            assert ward.steps >= 30
    finally:
        assert emulator.end() == 0
