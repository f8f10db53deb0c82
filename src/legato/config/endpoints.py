"""Where the daemon may listen: loopback only, until encryption with listed keys is there."""

import re
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path

from legato.config.errors import ConfigError

TCP = re.compile(r"tcp://(?P<host>\[[^\]]*\]|[^:\[\]]*):(?P<port>\d{1,5}|\*)")
LONGEST_PATH = 100  # a Unix socket's address has room for 107 bytes, some for its neighbours
EXPECTED = "tcp://127.0.0.1:PORT (PORT 1 to 65535, or * for a free one), or ipc://PATH"


def check_endpoint(file: Path, key: str, endpoint: str) -> None:
    """Raise ConfigError unless `endpoint` is a loopback TCP address or a Unix socket's path."""
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
    if match["host"] != "localhost" and (address is None or not address.is_loopback):
        hint = "beyond loopback the daemon needs encryption with a list of allowed client keys"
        raise ConfigError(file, key, endpoint, f"an address on loopback: {EXPECTED}", hint)


def resolved(endpoint: str, folder: Path) -> str:
    """Return an endpoint whose socket path, if any, is absolute."""
    path = endpoint.removeprefix("ipc://")
    if path == endpoint or not path:
        return endpoint
    return f"ipc://{folder / Path(path).expanduser()}"


def has_fixed_port(endpoint: str) -> bool:
    """Say whether a client can know where to connect from the configuration alone."""
    return not endpoint.endswith(":*")


def _address(host: str) -> IPv4Address | IPv6Address | None:
    """Return the address that `host` spells, or None for a name."""
    try:
        return ip_address(host.removeprefix("[").removesuffix("]"))
    except ValueError:
        return None
