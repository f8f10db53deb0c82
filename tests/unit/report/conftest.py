"""One whole synthetic session for all tests that only read it."""

from pathlib import Path

import pytest

from legato.records.record import SessionRecord, read_session
from legato.report.html import render
from tests.unit.report.sessions import whole_session


@pytest.fixture(scope="session")
def whole_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a whole session that ended as done."""
    return whole_session(tmp_path_factory.mktemp("whole"))


@pytest.fixture
def whole(whole_path: Path) -> SessionRecord:
    """Return its record, freshly read."""
    return read_session(whole_path)


@pytest.fixture(scope="session")
def whole_page(whole_path: Path) -> str:
    """Return its report."""
    return render(read_session(whole_path))
