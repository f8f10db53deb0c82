"""A store whose tokens count up, and a session with a few events in it."""

import itertools
from collections.abc import Callable
from pathlib import Path

import pytest

from legato.records.session import SessionWriter
from legato.records.store import Store

STARTED = "2026-11-22T01:47:00+00:00"
Begin = Callable[..., SessionWriter]


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """Return an empty store with predictable tokens."""
    counter = itertools.count()
    return Store(tmp_path / "state", token=lambda: f"{next(counter):04x}")


@pytest.fixture
def begin(store: Store) -> Begin:
    """Return a function that begins a session and writes events into it."""

    def build(events: int = 3, started: str = STARTED) -> SessionWriter:
        writer = store.begin({"job": "run", "started": started, "simulated": True, "params": {}})
        for n in range(events):
            data = {"state": f"s{n}", "previous": "idle", "text": 'Mühe, "quoted"\n'}
            writer.event("state", data, t=float(n), wall=f"2026-11-22T01:47:0{n % 10}+00:00")
        return writer

    return build
