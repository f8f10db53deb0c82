"""A simulated cell for the commands that need no daemon."""

from pathlib import Path

import pytest

from tests.unit.cli.samples import write_cell


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a simulated cell's file."""
    return write_cell(tmp_path_factory.mktemp("cell"))
