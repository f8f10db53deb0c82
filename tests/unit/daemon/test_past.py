"""What a dead daemon left: open sessions are closed, faults stay, the arm's place is kept."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from legato.daemon.messages import DevicesKnown
from legato.daemon.past import LATEST, read_older, read_past
from legato.daemon.sessions import KEPT
from legato.records.errors import RecordError
from legato.records.store import Store, Summary
from tests.unit.daemon.bench import STARTED, Silent
from tests.unit.daemon.house import GOOD, House

ARM = "teachmover /dev/ttyUSB0"


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """Give an empty store."""
    return Store(tmp_path)


def test_nothing_before_is_no_fault(store: Store) -> None:
    """The first start begins in idle, with an arm that must be referenced."""
    past = read_past(store, Silent(), arm=ARM)
    assert (past.fault, list(past.sessions), past.last) == (None, [], (None, None))


def test_an_open_session_is_interrupted(store: Store) -> None:
    """It gets its outcome, and the daemon its fault."""
    writer = store.begin({"job": "run", "started": STARTED})
    writer.close()
    past = read_past(store, Silent(), arm=None)
    assert past.fault is not None
    assert (past.fault["cause"], past.fault["session"]) == ("interrupted", writer.id)
    assert [s.outcome for s in past.sessions] == ["interrupted"]
    assert store.unfinished() == []


def test_a_full_disk_keeps_no_daemon_from_its_fault(
    store: Store,
) -> None:
    """A session that was open is interrupted for whoever asks, and for good with the next start."""
    writer = store.begin({"job": "run", "started": STARTED})
    writer.close()
    full = RecordError("no space left on device", "free some")

    class Full(Store):
        def save_state(self, state: Mapping[str, Any]) -> None:
            del state
            raise full

        def close_interrupted(self, session: str, ended: str | None = None) -> None:
            del session, ended
            raise full

    log = Silent()
    past = read_past(Full(store.state_dir), log, arm=None)
    assert past.fault is not None
    assert past.fault["session"] == writer.id
    assert [s.outcome for s in past.sessions] == ["interrupted"]
    assert store.unfinished() == [writer.id]
    assert read_past(store, log, arm=None).fault is not None
    assert store.unfinished() == []


def test_a_fault_outlives_its_daemon(store: Store) -> None:
    """Only reset leaves a fault; a restart does not."""
    fault = {"cause": "estop", "text": "t", "hint": "h", "since": "now", "session": None}
    store.save_state({"fault": fault})
    assert read_past(store, Silent(), arm=None).fault == fault


def test_the_arms_place_is_kept_for_the_same_real_arm_only(store: Store) -> None:
    """A simulated world begins anew; another arm, or one that woke up with zeros, is no proof."""
    known = {"reference": [1, 2, 3, 4, 5, 6], "registers": [0, 0, 7, 0, 0, 7], "fault": None}
    store.save_state(known | {"arm": ARM})
    assert read_past(store, Silent(), arm=ARM).last == ((1, 2, 3, 4, 5, 6), (0, 0, 7, 0, 0, 7))
    assert read_past(store, Silent(), arm=None).last == (None, None)
    assert read_past(store, Silent(), arm="teachmover /dev/ttyUSB1").last == (None, None)
    store.save_state(known | {"arm": None})
    assert read_past(store, Silent(), arm=ARM).last == (None, None)
    store.save_state(known | {"arm": ARM, "registers": [0] * 6})
    assert read_past(store, Silent(), arm=ARM).last == (None, None)


def test_the_interruption_is_kept_before_the_session_is_closed(store: Store) -> None:
    """A start that fails after this one still finds the fault."""
    store.begin({"job": "run", "started": STARTED}).close()
    read_past(store, Silent(), arm=None)
    again = read_past(store, Silent(), arm=None)
    assert again.fault is not None
    assert again.fault["cause"] == "interrupted"


@pytest.mark.parametrize("text", ["{", "[]", '{"fault": 5, "reference": [1], "registers": "x"}',
                                  '{"fault": {"cause": "nonsense"}}'])  # fmt: skip
def test_a_damaged_state_is_as_good_as_none(store: Store, text: str) -> None:
    """The daemon starts, and the arm must be referenced."""
    store.state_dir.mkdir(exist_ok=True)
    (store.state_dir / "state.json").write_text(text)
    past = read_past(store, Silent(), arm=ARM)
    assert (past.fault, past.last) == (None, (None, None))


class Counted(Store):
    """A store of so many finished sessions that counts how many of them are read."""

    count = KEPT + 500
    read_ones = 0

    def _paths(self) -> Iterator[Path]:
        """Yield the folders that there would be."""
        for number in range(self.count):
            yield (
                self.folder
                / f"20261101T{number // 3600:02}{number // 60 % 60:02}{number % 60:02}Z-0"
            )

    def _summary(self, path: Path) -> Summary:
        """Count, then make one up."""
        self.read_ones += 1
        return Summary(path.name, "run", path.name, path.name, "done", None, None, True)


def test_a_start_reads_no_more_for_there_being_more(tmp_path: Path) -> None:
    """The latest before anybody is answered; those that are remembered beside them afterwards."""
    store = Counted(tmp_path)
    past = read_past(store, Silent(), arm=None)
    assert store.read_ones == len(past.sessions) == LATEST
    older = read_older(store, Silent())
    assert store.read_ones == LATEST + KEPT
    assert len({s.id for s in (*past.sessions, *older)}) == KEPT
    assert max(s.id for s in older) < min(s.id for s in past.sessions)


def test_an_older_session_without_an_end_is_a_fault_as_soon_as_it_is_found(tmp_path: Path) -> None:
    """Its fault is kept before it is closed; the others are known, and their keys."""
    house = House(tmp_path)
    writers = [
        house.store.begin({"job": "run", "started": STARTED, "key": f"k{n}"}) for n in (1, 2)
    ]
    writers[0].finish("done", None, None, STARTED)
    writers[1].close()
    house.hear(DevicesKnown(GOOD, {}, house.store.sessions()))
    fault = house.conductor.standing.fault
    assert fault is not None
    assert (fault["cause"], house.store.load_state()["fault"]) == ("interrupted", fault)
    assert house.store.unfinished() == []
    known = house.sessions.with_key("k1")
    assert known is not None
    assert known.id == writers[0].id
