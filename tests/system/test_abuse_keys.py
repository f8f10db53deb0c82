"""Strangers at the encrypted sockets of the real daemon: refused by name, and told nothing."""

import time
from collections.abc import Iterator

import pytest

from legato.daemon.client import Client
from legato.daemon.keys import Keys, make_keys, read_public, read_secret
from legato.daemon.link import KeyRefused
from tests.system.attacked import LINES, SHORT, Attacked, attacked
from tests.system.strangers import STRANGERS, overheard, refused, unlisted


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Attacked, Keys]]:
    """Give an encrypted daemon, and its operator's keys."""
    folder = tmp_path_factory.mktemp("k")
    secret, public = make_keys(folder, "cell", "server")
    mine, _ = make_keys(folder / "clients", "anna", "operator")
    own, server = read_secret(mine, ""), read_public(public, "").public.encode()
    curve = {"secret": str(secret), "clients": str(folder / "clients")}
    with attacked(folder / "cell", {**SHORT, "server": {"curve": curve}}) as running:
        yield running, Keys(own.public, own.secret, server)


@pytest.mark.parametrize("where", LINES)
@pytest.mark.parametrize("who", STRANGERS)
def test_a_stranger_is_told_and_comes_no_further(
    cell: tuple[Attacked, Keys], who: str, where: str
) -> None:
    """An unlisted key, none at all, a listed one that takes the daemon for another: on each line.

    None of them waits for a time-out, and the log has each.
    """
    running, keys = cell
    before = running.turned_away()
    refused(running.lines[where], who, keys, events=where == "events")
    with Client(running.lines["requests"], keys=keys) as anna:
        assert anna.call("ping")["state"] == "idle"
    assert running.turned_away_after(before) > before


def test_many_strangers_do_not_fill_the_log(cell: tuple[Attacked, Keys]) -> None:
    """Thirty in a row are thirty in the log, in a few lines."""
    running, keys = cell
    before, lines = running.turned_away(), len(running.logged("turned_away"))
    began = time.monotonic()
    for _ in range(30):
        refused(running.lines["requests"], "unlisted", keys)
    assert running.turned_away_after(before + 29) >= before + 30
    assert len(running.logged("turned_away")) - lines <= 3 * (time.monotonic() - began + 2)


@pytest.mark.parametrize("where", LINES)
def test_an_encrypted_socket_tells_a_plain_peer_nothing(
    cell: tuple[Attacked, Keys], where: str
) -> None:
    """All that ever comes back is ZeroMQ's greeting: no state, no event, no name."""
    running, _ = cell
    assert len(overheard(running.lines[where])) <= 64


def test_refusals_have_the_clients_own_error(cell: tuple[Attacked, Keys]) -> None:
    """The class of the error, its code and its hint are what a program can act on."""
    running, keys = cell
    stranger = Keys(*unlisted(keys))
    with Client(running.lines["stop"], keys=stranger) as client, pytest.raises(KeyRefused) as told:
        client.call("estop")
    assert told.value.code == -32002
    assert "daemon's folder of clients" in str(told.value.data["hint"])
