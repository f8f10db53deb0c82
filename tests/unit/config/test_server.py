"""The keys of `[server]`: beyond loopback only with keys, and each side with all that it needs."""

import pytest

from legato.config.endpoints import reachable
from legato.config.errors import ConfigError
from legato.config.load import load, load_server
from tests.unit.config.samples import SIM, Write

FAR = "requests = 'tcp://192.0.2.1:5760'\n"
CURVE = "curve = {secret = 'keys/cell.secret', clients = 'keys/clients'}\n"
CLIENT = "client_secret = 'anna.secret'\nserver_public = 'cell.public'\n"


def test_a_daemon_beyond_loopback_needs_its_own_keys(write: Write) -> None:
    """The keys of a client do not make a daemon safe."""
    assert load(write(SIM + "[server]\n" + FAR + CURVE)).config.server.curve is not None
    for keys in ("", CLIENT):
        with pytest.raises(ConfigError, match=r"server\.requests.*encryption"):
            load(write(SIM + "[server]\n" + FAR + keys))


def test_a_client_beyond_loopback_needs_its_keys(write: Write) -> None:
    """A name is fine there, since the daemon's key says whom one talks to."""
    server = load_server(write("[server]\nrequests = 'tcp://cell.lab:5760'\n" + CLIENT))
    assert server.requests == "tcp://cell.lab:5760"
    with pytest.raises(ConfigError, match=r"server\.requests.*encryption"):
        load_server(write("[server]\n" + FAR))


@pytest.mark.parametrize("half", CLIENT.splitlines())
def test_half_of_a_clients_keys_are_refused(write: Write, half: str) -> None:
    """The secret and the daemon's public key are given together."""
    with pytest.raises(ConfigError, match="make keys"):
        load_server(write(f"[server]\n{half}\n"))


def test_key_files_are_relative_to_the_configuration(write: Write) -> None:
    """Like every other path of the file."""
    file = write("[server]\n" + CURVE + CLIENT)
    server = load_server(file)
    assert server.curve is not None
    assert server.curve.secret == str(file.parent / "keys/cell.secret")
    assert server.curve.clients == str(file.parent / "keys/clients")
    assert server.client_secret == str(file.parent / "anna.secret")
    assert server.server_public == str(file.parent / "cell.public")


@pytest.mark.parametrize(
    ("listens", "found"),
    [
        ("tcp://0.0.0.0:5760", "tcp://127.0.0.1:5760"),
        ("tcp://*:5760", "tcp://127.0.0.1:5760"),
        ("tcp://[::]:5760", "tcp://[::1]:5760"),
        ("tcp://192.0.2.1:5760", "tcp://192.0.2.1:5760"),
        ("ipc:///run/legato/requests", "ipc:///run/legato/requests"),
    ],
)
def test_a_client_beside_the_daemon_finds_it(listens: str, found: str) -> None:
    """A daemon that listens everywhere is found on loopback."""
    assert reachable(listens) == found


@pytest.mark.parametrize("listen", ["127.0.0.1:9108", "127.9.9.9:0", "[::1]:9108", "localhost:1"])
def test_metrics_listen_on_loopback(write: Write, listen: str) -> None:
    """By address or by name, at a port or at a free one; nowhere unless told."""
    assert load(write(SIM)).config.metrics.listen is False
    assert load(write(SIM + "[metrics]\nlisten = false\n")).config.metrics.listen is False
    found = load(write(SIM + f"[metrics]\nlisten = '{listen}'\n")).config.metrics.listen
    assert found == listen


@pytest.mark.parametrize(
    "listen",
    ["true", "'0.0.0.0:9108'", "'192.0.2.1:9108'", "'[::]:9108'", "'cell.lab:9108'", "':9108'",
     "'9108'", "'127.0.0.1:70000'", "'127.0.0.1'", "'tcp://127.0.0.1:9108'", "9108"],
)  # fmt: skip
def test_metrics_never_listen_beyond_loopback(write: Write, listen: str) -> None:
    """Neither an address nor a name beyond it, and nothing that is no address at all."""
    with pytest.raises(ConfigError, match=r"metrics\.listen"):
        load(write(SIM + f"[metrics]\nlisten = {listen}\n"))
