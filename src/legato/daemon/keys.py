"""Key files: made, read, and refused where others could read a secret or grant themselves a role.

A pair is two TOML files, NAME.secret (mode 0600) and NAME.public, each with name, role and key.
The daemon lets in whose public file lies in its folder of clients.
"""

import os
import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Final

import zmq
from msgspec import Meta, Struct

from legato.config.decode import decode, read_toml
from legato.config.errors import ConfigError
from legato.config.schema import ServerTable
from legato.config.toml import dumps
from legato.control.table import ROLES
from legato.daemon.who import Who

NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}", re.ASCII)
HINT: Final = "make keys with `legato keygen`"

Z85 = Annotated[str, Meta(min_length=40, max_length=40)]


@dataclass(frozen=True)
class Keys:
    """A key pair in Z85, and for a client the daemon's public key; secrets stay out of texts."""

    public: bytes
    secret: bytes = field(repr=False)
    server: bytes = b""


class PublicFile(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What NAME.public holds."""

    name: str
    role: str
    public: Z85


class SecretFile(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What NAME.secret holds."""

    name: str
    role: str
    public: Z85
    secret: Z85


def make_keys(folder: Path, name: str, role: str) -> tuple[Path, Path]:
    """Write a new pair of files and return the secret's path and the public one's.

    Raises FileExistsError rather than replace a key, OSError.
    """
    if not NAME.fullmatch(name):
        raise ValueError(f"{name!r} is no name for a key: letters, digits, - and _, 64 at most")
    folder.mkdir(parents=True, exist_ok=True)
    public, secret = zmq.curve_keypair()
    document = {"name": name, "role": role, "public": public.decode()}
    hidden, shown = folder / f"{name}.secret", folder / f"{name}.public"
    if shown.exists():
        raise FileExistsError(17, "exists already", str(shown))
    whole = dumps(document | {"secret": secret.decode()}, "Keep this to yourself.")
    _write_new(hidden, whole, 0o600)
    _write_new(shown, dumps(document, "For the other side."), 0o644)
    return hidden, shown


def read_secret(file: Path, key: str) -> Keys:
    """Return the pair in a secret file. Raises ConfigError, also where others can read it.

    Among systemd's credentials one of the same file name comes first.
    """
    file = _credential(file)
    _check_mode(file, key, 0o077, "a file that only its owner can read", f"chmod 600 {file}")
    found = decode(read_toml(file, "a key's secret file"), SecretFile, file)
    pair = found.public.encode(), found.secret.encode()
    if _derived(pair[1]) != pair[0]:
        raise ConfigError(file, "secret", "a key", "the secret of the public key beside it", HINT)
    return Keys(*pair)


def read_public(file: Path, key: str) -> PublicFile:
    """Return what a public file holds. Raises ConfigError, also where others could change it."""
    _check_mode(file, key, 0o022, "a file that only its owner can change", f"chmod go-w {file}")
    found = decode(read_toml(file, "a public key file"), PublicFile, file)
    if not NAME.fullmatch(found.name):
        raise ConfigError(file, "name", found.name, "letters, digits, - and _, 64 at most")
    return found


def read_clients(folder: Path) -> Mapping[bytes, Who]:
    """Return who may come in, by public key: one *.public file each. Raises ConfigError."""
    key = "server.curve.clients"
    if not folder.is_dir():
        raise ConfigError(folder, key, str(folder), "a folder with a *.public file a client", HINT)
    _check_mode(folder, key, 0o022, "a folder that only its owner can change", "chmod go-w it")
    clients: dict[bytes, Who] = {}
    for file in sorted(folder.glob("*.public")):
        found = read_public(file, key)
        if found.role not in ROLES:
            raise ConfigError(file, "role", found.role, f"one of {', '.join(ROLES)}", HINT)
        names = {who.name for who in clients.values()}
        if found.public.encode() in clients or found.name in names:
            raise ConfigError(file, "name", found.name, "a name and a key that no other file has")
        clients[found.public.encode()] = Who(found.name, found.role)
    return clients


def client_keys(server: ServerTable, file: Path | str) -> Keys | None:
    """Return what a client of this configuration needs, None where nothing is encrypted."""
    if server.client_secret is None or server.server_public is None:
        if server.curve is None:
            return None
        missing = "client_secret" if server.client_secret is None else "server_public"
        expected = "a key file, since this daemon's line is encrypted"
        raise ConfigError(file, f"server.{missing}", "nothing", expected, HINT)
    own = read_secret(Path(server.client_secret), "server.client_secret")
    other = read_public(Path(server.server_public), "server.server_public")
    return Keys(own.public, own.secret, other.public.encode())


def _write_new(file: Path, text: str, mode: int) -> None:
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
    with os.fdopen(os.open(file, flags, mode), "w", encoding="utf-8") as stream:
        os.fchmod(stream.fileno(), mode)  # whatever the umask is
        stream.write(text)


def _check_mode(file: Path, key: str, forbidden: int, expected: str, hint: str) -> None:
    """Raise ConfigError where others may do with a file what they must not."""
    try:
        mode = stat.S_IMODE(file.stat().st_mode)
    except OSError as error:
        raise ConfigError(
            file, key, str(file), f"a file that can be read: {error.strerror}", HINT
        ) from error
    if mode & forbidden and not _closed(file.parent):
        raise ConfigError(file, key, f"mode {mode:04o}", expected, hint)


def is_closed(mode: int, owner: int, group: int, us: int) -> bool:
    """Say whether a folder of this mode is closed to all but root and `us`.

    Where an access list lets us in, as systemd's may, the folder is root's, and the bits of its
    group, which is root's too, show what the list allows.
    """
    roots = (owner, group) == (0, 0)
    return owner in (0, us) and not mode & (0o027 if roots else 0o077)


def _closed(folder: Path) -> bool:
    """Say whether a folder is that of systemd's credentials, and as closed as systemd makes it.

    Then its files' bits do not matter.
    """
    if folder != _credentials():
        return False
    try:
        found = folder.stat()
    except OSError:
        return False
    return is_closed(found.st_mode, found.st_uid, found.st_gid, os.geteuid())


def _credentials() -> Path | None:
    """Return the folder in which systemd has put this service's credentials."""
    folder = os.environ.get("CREDENTIALS_DIRECTORY")
    return Path(folder) if folder else None


def _credential(file: Path) -> Path:
    folder = _credentials()
    return folder / file.name if folder is not None and (folder / file.name).is_file() else file


def _derived(secret: bytes) -> bytes:
    """Return the public key of a secret one, nothing where it is none."""
    try:
        return zmq.curve_public(secret)
    except (zmq.ZMQError, ValueError):
        return b""
