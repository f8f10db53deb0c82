"""Junk on every socket of the real daemon: it is answered or dropped, and nothing else suffers."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from legato.daemon.keys import Keys, make_keys, read_public, read_secret
from tests.system.attacked import SHORT, Attacked, attacked
from tests.system.line import Line, answering
from tests.system.pelting import KINDS, pelt

MESSAGES = 400


@pytest.fixture(params=["plain", "CURVE"])
def cell(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[Attacked, Keys | None]]:
    """Give a daemon with and without encryption, and a key of its operator."""
    tables, keys = dict(SHORT), None
    if request.param == "CURVE":
        secret, public = make_keys(tmp_path, "cell", "server")
        mine, _ = make_keys(tmp_path / "clients", "anna", "operator")
        own = read_secret(mine, "")
        keys = Keys(own.public, own.secret, read_public(public, "").public.encode())
        curve = {"secret": str(secret), "clients": str(tmp_path / "clients")}
        tables["server"] = {"curve": curve}
    with attacked(tmp_path / "cell", tables) as running:
        yield running, keys


def test_junk_restarts_nothing_and_nobody_waits_for_it(cell: tuple[Attacked, Keys | None]) -> None:
    """Frames of every kind, subscriptions, bare bytes: the same process answers all the while."""
    running, keys = cell
    told = pelt(running, MESSAGES, keys)
    assert set(told.thrown) == set(KINDS)
    assert len(told.boots) == 1
    assert running.process.poll() is None
    assert max(told.late_s) < 2.0
    assert answering(running.lines["stop"], keys) < 2.0
    assert not [line for line in running.logged() if line["event"] == "bug"]
    assert not running.said()


def test_a_peer_that_reads_nothing_holds_nobody_up(tmp_path: Path) -> None:
    """Who asks without end and never reads an answer costs the others nothing but its share."""
    with attacked(tmp_path, SHORT) as running:
        deaf, line = Line(running.lines["requests"]), Line(running.lines["requests"])
        try:
            before = running.megabytes()
            for _ in range(3000):
                deaf.send("describe")
            began = time.monotonic()
            assert line.do("status")["state"] == "idle"
            assert time.monotonic() - began < 10.0
            # What it may keep for one peer is bounded: a thousand answers and the kernel's share.
            assert running.megabytes() - before < 120.0
        finally:
            deaf.close()
            line.close()
