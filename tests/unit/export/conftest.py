"""One whole synthetic session, and one that broke off before it found the leg."""

from pathlib import Path

import pytest

from legato.records.record import SessionRecord, read_session
from tests.unit.report.sessions import begun, whole_session

PACE = 20.0


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> SessionRecord:
    """Return the record of a whole session that ended as done."""
    return read_session(whole_session(tmp_path_factory.mktemp("exported")))


@pytest.fixture(scope="session")
def hasty(tmp_path_factory: pytest.TempPathFactory) -> SessionRecord:
    """Return the same session of a cell whose clock ran PACE times as fast as the wall's."""
    return read_session(whole_session(tmp_path_factory.mktemp("hasty"), PACE))


@pytest.fixture
def broken_off(tmp_path: Path) -> SessionRecord:
    """Return the record of a session that ended in a fault, its last line torn."""
    cell = begun(tmp_path)
    cell.enter("capture", "idle")
    cell.look()
    cell.event("fault", cause="marks_not_found", text="no marks", hint="look", evidence={"n": 2})
    path = cell.writer.path
    with (path / "events.jsonl").open("ab") as file:
        file.write(b'{"seq":9,"wall":"2026-')
    return read_session(path)
