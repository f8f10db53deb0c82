"""From a file to a configuration that may be used, or a ConfigError; nothing else opens.

Relative paths are relative to the file that names them, and `~` is the user's home.
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from legato.config.check import check, check_server
from legato.config.decode import decode, read_toml
from legato.config.endpoints import resolved
from legato.config.errors import ConfigError
from legato.config.intrinsics import IntrinsicsFile, read_intrinsics
from legato.config.place import absolute
from legato.config.schema import Config, ServerTable

PACKAGE = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Loaded:
    """A checked configuration.

    `path` is the file; `data` the whole configuration with defaults and absolute paths, ready for
    JSON; `hash` the SHA-256 of that and of the intrinsics; `intrinsics` the camera's file, if any.
    """

    config: Config
    path: Path
    hash: str
    data: dict[str, Any]
    intrinsics: IntrinsicsFile | None = None


def load(path: Path | None = None, *, need_intrinsics: bool = True) -> Loaded:
    """Return the configuration in `path`, by default the shipped simulated cell's.

    Where `need_intrinsics` is false an intrinsics file that cannot be read is let pass: that is
    for making one. Raises ConfigError, naming file, key, value and what was expected.
    """
    file = path if path is not None else shipped("sim.toml")
    config = _absolute(decode(read_toml(file, "a configuration file"), Config, file), file)
    check(config, file)
    intrinsics = None
    if config.camera.intrinsics is not None:
        try:
            intrinsics = _fitting_intrinsics(config, file)
        except ConfigError:
            if need_intrinsics:
                raise
    data = msgspec.to_builtins(config)
    return Loaded(config, file.resolve(), _digest(data, intrinsics), data, intrinsics)


def load_server(path: Path | None = None) -> ServerTable:
    """Return only where the daemon listens, so that a client works whatever else is wrong.

    Raises ConfigError for a file that cannot be read and for the keys of `[server]`.
    """
    file = path if path is not None else shipped("sim.toml")
    tables = read_toml(file, "a configuration file")
    data = {"server": tables["server"]} if "server" in tables else {}
    server = _absolute(decode(data, Config, file), file).server
    check_server(server, file, encrypted=server.curve is not None or server.is_client)
    return server


def shipped(name: str) -> Path:
    """Return a file of etc/: beside the package in a wheel, or the repository's own."""
    inside = PACKAGE / "etc" / name
    return inside if inside.is_file() else PACKAGE.parents[1] / "etc" / name


def _fitting_intrinsics(config: Config, file: Path) -> IntrinsicsFile:
    """Return the camera's intrinsics. Raises ConfigError where they are of another picture size."""
    named = Path(str(config.camera.intrinsics))
    if not named.is_file():
        hint = "make it with `legato intrinsics`"
        raise ConfigError(file, "camera.intrinsics", str(named), "a file that exists", hint)
    found = read_intrinsics(named)
    size, wanted = (found.width, found.height), (config.camera.width, config.camera.height)
    if size != wanted:
        expected = f"intrinsics of {wanted[0]}x{wanted[1]} (camera.width, camera.height)"
        value = f"{named} of {size[0]}x{size[1]}"
        raise ConfigError(file, "camera.intrinsics", value, expected)
    return found


def _absolute(config: Config, file: Path) -> Config:
    """Return the configuration with every path absolute."""
    folder = file.resolve().parent
    replace = msgspec.structs.replace
    server, camera = config.server, config.camera
    if camera.intrinsics is not None:
        camera = replace(camera, intrinsics=absolute(camera.intrinsics, folder))
    if isinstance(camera.source, str) and "://" not in camera.source:
        camera = replace(camera, source=absolute(camera.source, folder))
    server = replace(
        server,
        requests=resolved(server.requests, folder),
        events=resolved(server.events, folder),
        stop=resolved(server.stop, folder),
        client_secret=_optional(server.client_secret, folder),
        server_public=_optional(server.server_public, folder),
    )
    if server.curve is not None:
        secret, clients = (
            absolute(server.curve.secret, folder),
            absolute(server.curve.clients, folder),
        )
        server = replace(server, curve=replace(server.curve, secret=secret, clients=clients))
    records = replace(config.records, state_dir=absolute(config.records.state_dir, folder))
    return replace(config, server=server, camera=camera, records=records)


def _optional(name: str | None, folder: Path) -> str | None:
    return None if name is None else absolute(name, folder)


def _digest(data: dict[str, Any], intrinsics: IntrinsicsFile | None) -> str:
    """Return the SHA-256 of everything that the cell is told."""
    whole = {"config": data, "intrinsics": msgspec.to_builtins(intrinsics)}
    text = json.dumps(whole, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
