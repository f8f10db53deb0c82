"""Reads a TOML file and decodes it as a Struct; every refusal is a ConfigError."""

import math
import threading
import tomllib
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from legato.config.errors import ConfigError
from legato.config.expected import refusal

T = TypeVar("T")

# Two threads that are the first to use a type of msgspec's at once crash the process.
_ALONE = threading.Lock()
LARGEST_FILE = 1_000_000  # bytes; a configuration is a few thousand


def read_toml(file: Path, what: str) -> dict[str, Any]:
    """Return the tables of a TOML file; `what` names it in errors. Raises ConfigError."""
    try:
        with file.open("rb") as stream:
            raw = stream.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ConfigError(file, "", reason, f"{what} that can be read") from error
    if len(raw) > LARGEST_FILE:
        raise ConfigError(file, "", "a larger file", f"{what} of at most {LARGEST_FILE} bytes")
    try:
        return tomllib.loads(raw.decode("utf-8"))
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise ConfigError(file, "", f"byte {error.start} (line {line})", "UTF-8 text") from error
    except RecursionError as error:
        raise ConfigError(file, "", "tables or lists nested too deep", "TOML") from error
    except ValueError as error:  # TOMLDecodeError, and numbers beyond Python's own limits
        raise ConfigError(file, "", str(error), "TOML") from error


def decode(data: Any, of: type[T], file: Path) -> T:
    """Return `data` as a Struct `of`, strictly. Raises ConfigError naming key and value."""
    refuse_not_finite(data, file)
    try:
        with _ALONE:
            return msgspec.convert(data, of, strict=True)
    except msgspec.ValidationError as error:
        raise refusal(error, data, of, file) from error


def refuse_not_finite(data: Any, file: Path, key: str = "") -> None:
    """Raise ConfigError for the first nan or inf: TOML has them, a cell has not."""
    if isinstance(data, dict):
        for name, value in data.items():
            refuse_not_finite(value, file, f"{key}.{name}" if key else name)
    elif isinstance(data, list):
        for index, value in enumerate(data):
            refuse_not_finite(value, file, f"{key}[{index}]")
    elif isinstance(data, float) and not math.isfinite(data):
        raise ConfigError(file, key, data, "a finite number")
