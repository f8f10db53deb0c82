"""What a dead daemon left: open sessions are closed, faults stay, the arm's place is kept."""

from pathlib import Path

import pytest

from legato.daemon.past import read_past
from legato.records.store import Store
from tests.unit.daemon.bench import STARTED, Silent


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """Give an empty store."""
    return Store(tmp_path)


def test_nothing_before_is_no_fault(store: Store) -> None:
    """The first start begins in idle, with an arm that must be referenced."""
    past = read_past(store, Silent(), simulated=False)
    assert (past.fault, list(past.sessions), past.last) == (None, [], (None, None))


def test_an_open_session_is_interrupted(store: Store) -> None:
    """It gets its outcome, and the daemon its fault."""
    writer = store.begin({"job": "run", "started": STARTED})
    writer.close()
    past = read_past(store, Silent(), simulated=True)
    assert past.fault is not None
    assert (past.fault["cause"], past.fault["session"]) == ("interrupted", writer.id)
    assert [s.outcome for s in past.sessions] == ["interrupted"]
    assert store.unfinished() == []


def test_a_fault_outlives_its_daemon(store: Store) -> None:
    """Only reset leaves a fault; a restart does not."""
    fault = {"cause": "estop", "text": "t", "hint": "h", "since": "now", "session": None}
    store.save_state({"fault": fault})
    assert read_past(store, Silent(), simulated=True).fault == fault


def test_the_arms_place_is_kept_for_a_real_arm_only(store: Store) -> None:
    """A simulated world begins anew, a real arm still stands where it stood."""
    store.save_state({"reference": [1, 2, 3, 4, 5, 6], "registers": [0] * 6, "fault": None})
    real = read_past(store, Silent(), simulated=False)
    assert real.last == ((1, 2, 3, 4, 5, 6), (0,) * 6)
    assert read_past(store, Silent(), simulated=True).last == (None, None)


@pytest.mark.parametrize("text", ["{", "[]", '{"fault": 5, "reference": [1], "registers": "x"}',
                                  '{"fault": {"cause": "nonsense"}}'])  # fmt: skip
def test_a_damaged_state_is_as_good_as_none(store: Store, text: str) -> None:
    """The daemon starts, and the arm must be referenced."""
    store.state_dir.mkdir(exist_ok=True)
    (store.state_dir / "state.json").write_text(text)
    past = read_past(store, Silent(), simulated=False)
    assert (past.fault, past.last) == (None, (None, None))
