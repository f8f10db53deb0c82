"""The configuration under test as files in a temporary folder."""

from pathlib import Path

import pytest

from legato.config.intrinsics import write_intrinsics
from tests.unit.config.samples import Write, known


@pytest.fixture
def lens(tmp_path: Path) -> Path:
    """Return an intrinsics file that fits the default camera."""
    file = tmp_path / "lens.toml"
    write_intrinsics(file, known(), views=20, rms_px=0.1, created="2026-11-20T10:00:00+00:00")
    return file


@pytest.fixture
def write(tmp_path: Path, lens: Path) -> Write:
    """Return what writes a configuration beside the intrinsics file and returns its path."""
    assert lens.is_file()

    def to_file(text: str) -> Path:
        file = tmp_path / "cell.toml"
        file.write_text(text, encoding="utf-8")
        return file

    return to_file
