"""Folders and heads that no daemon wrote: lists, pruning and verifying go on all the same."""

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from legato.records.errors import RecordError
from legato.records.files import encode
from legato.records.store import Store
from legato.records.whole import verify_record
from tests.unit.records.conftest import STARTED, Begin

NOW = datetime.fromisoformat(STARTED) + timedelta(days=30)
ENDED = "2026-11-22T02:00:00+00:00"
ODD_TIMES = ("0001-01-01T00:00:00+14:00", "9999-12-31T23:59:59-14:00", "-1", "2026", "now")
LEAVES = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
ANY = (
    st.sampled_from(ODD_TIMES)
    | LEAVES
    | st.recursive(LEAVES, lambda of: st.lists(of) | st.dictionaries(st.text(), of), max_leaves=6)
)


@pytest.mark.parametrize("name", ["99999999T999999Z-abcd", "20260230T000000Z-0000"])
def test_a_folder_of_no_real_time_is_no_session(store: Store, begin: Begin, name: str) -> None:
    """It is neither listed, read, closed nor removed."""
    begin(1).finish("done", None, None, ENDED)
    (store.folder / name).mkdir()
    assert [s.outcome for s in store.sessions()] == ["done"]
    assert store.unfinished() == []
    with pytest.raises(RecordError, match="no session id"):
        store.read(name)
    assert len(store.prune(1.0, NOW)) == 1
    assert (store.folder / name).is_dir()


@pytest.mark.parametrize("ended", [*ODD_TIMES[:1], 5, ["x"], "gone"])
def test_a_time_that_cannot_be_read_is_the_ids(store: Store, begin: Begin, ended: Any) -> None:
    """An old session goes when it is old, whatever it says of its end; a young one stays."""
    old, young = begin(1), begin(1, (NOW - timedelta(hours=2)).isoformat())
    for writer in (old, young):
        meta = writer.finish("done", None, None, ENDED)
        (writer.path / "session.json").write_bytes(encode(meta | {"ended": ended}))
    assert store.prune(7.0, NOW, keep_newest=0) == [old.id]
    assert [s.id for s in store.sessions()] == [young.id]


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    odd=st.fixed_dictionaries(
        {}, optional=dict.fromkeys(("started", "ended", "outcome", "reason", "seal", "key"), ANY)
    ),
    seal=st.fixed_dictionaries(
        {}, optional=dict.fromkeys(("events", "last", "torn", "files", "head"), ANY)
    ),
)
def test_whatever_a_head_says_nothing_is_held_up(
    tmp_path: Path, odd: dict[str, Any], seal: dict[str, Any]
) -> None:
    """Any JSON in place of times, outcome and seal: list, verify, close and prune do their work."""
    store = Store(tmp_path / os.urandom(4).hex())
    writer = store.begin({"job": "run", "started": STARTED, "key": None})
    writer.event("session", {"id": writer.id, "job": "run"}, t=0.0, wall=STARTED)
    meta = writer.finish("done", None, None, ENDED)
    changed = meta | {"seal": meta["seal"] | seal} | odd
    (writer.path / "session.json").write_bytes(encode(changed))
    (summary,) = store.sessions()
    assert all(isinstance(v, str | None) for v in (summary.ended, summary.outcome, summary.key))
    assert not verify_record(writer.path).ok  # the newline is missing, if nothing else
    store.close_interrupted(writer.id)
    assert store.unfinished() == []
    store.prune(1.0, NOW, min_free_mb=0.0)
    store.prune(0.0, datetime.max.replace(tzinfo=UTC), min_free_mb=0.0)
    assert store.sessions() == []
