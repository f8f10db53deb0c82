"""Where the daemon may listen: beyond loopback only where the line is encrypted."""

import re
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path

from legato.config.errors import ConfigError

TCP = re.compile(r"tcp://(?P<host>\[[^\]]*\]|[^:\[\]]*):(?P<port>\d{1,5}|\*)")
LONGEST_PATH = 100  # a Unix socket's address has room for 107 bytes, some for its neighbours
EVERYWHERE = {"*": "127.0.0.1", "0.0.0.0": "127.0.0.1", "[::]": "[::1]"}  # and its loopback
EXPECTED = "tcp://127.0.0.1:PORT (PORT 1 to 65535, or * for a free one), or ipc://PATH"


def check_endpoint(file: Path, key: str, endpoint: str, *, encrypted: bool) -> None:
    """Raise ConfigError unless `endpoint` is a TCP address or a Unix socket's path.

    Beyond loopback the line must be `encrypted`.
    """
    if endpoint.startswith("ipc://"):
        path = endpoint.removeprefix("ipc://")
        if not 0 < len(path.encode()) <= LONGEST_PATH or path.startswith(("*", "@")):
            expected = f"ipc:// and a path of 1 to {LONGEST_PATH} bytes"
            raise ConfigError(file, key, endpoint, expected)
        return
    match = TCP.fullmatch(endpoint)
    if match is None:
        raise ConfigError(file, key, endpoint, EXPECTED)
    if match["port"] != "*" and not 0 < int(match["port"]) < 65536:
        raise ConfigError(file, key, endpoint, EXPECTED)
    address = _address(match["host"])
    if encrypted and match["host"]:
        return
    if match["host"] != "localhost" and (address is None or not address.is_loopback):
        hint = (
            "beyond loopback the line needs encryption: server.curve at the daemon, "
            "server.client_secret and server.server_public at a client"
        )
        raise ConfigError(file, key, endpoint, f"an address on loopback: {EXPECTED}", hint)


def check_listen(file: Path, key: str, listen: str | bool) -> None:
    """Raise ConfigError unless `listen` is false, or HOST:PORT on loopback."""
    expected = "false, or an address on loopback such as 127.0.0.1:9108 (port 0 for a free one)"
    if listen is False:
        return
    address = listen_address(listen) if isinstance(listen, str) else None
    if address is None:
        raise ConfigError(file, key, listen, expected)
    host = _address(address[0])
    if address[0] != "localhost" and (host is None or not host.is_loopback):
        hint = "let a proxy or an agent on this machine carry them further"
        raise ConfigError(file, key, listen, expected, hint)


def listen_address(listen: str) -> tuple[str, int] | None:
    """Return host and port of HOST:PORT, an IPv6 host without brackets; None where it is none."""
    match = re.fullmatch(r"(?P<host>\[[^\]]+\]|[^:\[\]]+):(?P<port>\d{1,5})", listen)
    if match is None or int(match["port"]) > 65535:
        return None
    return match["host"].removeprefix("[").removesuffix("]"), int(match["port"])


def resolved(endpoint: str, folder: Path) -> str:
    """Return an endpoint whose socket path, if any, is absolute."""
    path = endpoint.removeprefix("ipc://")
    if path == endpoint or not path:
        return endpoint
    return f"ipc://{folder / Path(path).expanduser()}"


def reachable(endpoint: str) -> str:
    """Return where a client on this machine finds a daemon that listens at `endpoint`."""
    match = TCP.fullmatch(endpoint)
    if match is None or match["host"] not in EVERYWHERE:
        return endpoint
    return f"tcp://{EVERYWHERE[match['host']]}:{match['port']}"


def has_fixed_port(endpoint: str) -> bool:
    """Say whether a client can know where to connect from the configuration alone."""
    return not endpoint.endswith(":*")


def _address(host: str) -> IPv4Address | IPv6Address | None:
    """Return the address that `host` spells, or None for a name."""
    try:
        return ip_address(host.removeprefix("[").removesuffix("]"))
    except ValueError:
        return None
