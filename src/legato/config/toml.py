"""A small TOML writer for what legato itself writes: numbers, texts, lists and tables.

What is written reads back as the same value; None has no place in TOML and is left out.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def dumps(document: Mapping[str, Any], comment: str = "") -> str:
    """Return `document` as TOML, with `comment` lines on top.

    Raises TypeError for a value that TOML cannot say.
    """
    head = "".join(f"# {line}".rstrip() + "\n" for line in comment.splitlines())
    return head + "\n".join(_table(document, ())) + "\n"


def _table(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    """Return the lines of one table: its own keys first, then its tables."""
    lines = [f"[{'.'.join(_key(part) for part in path)}]"] if path else []
    for name, value in table.items():
        if value is not None and not isinstance(value, Mapping):
            lines.append(f"{_key(name)} = {_value(value)}")
    for name, value in table.items():
        if isinstance(value, Mapping):
            lines += ["", *_table(value, (*path, name))]
    return lines


def _key(name: str) -> str:
    """Return a key, quoted where it must be."""
    return name if BARE_KEY.fullmatch(name) else _text(name)


def _value(value: Any) -> str:
    """Return one value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return _number(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Sequence):
        return _list(value)
    if isinstance(value, Mapping):  # inside a list, where no heading can stand
        return f"{{{', '.join(f'{_key(k)} = {_value(v)}' for k, v in value.items())}}}"
    raise TypeError(f"{type(value).__name__} has no place in TOML: {value!r}")


def _number(value: float) -> str:
    """Return a float so that it reads back as the same float."""
    if math.isnan(value):
        return "nan"
    return repr(value) if math.isfinite(value) else ("inf" if value > 0 else "-inf")


def _text(value: str) -> str:
    """Return a basic string; JSON's escapes are TOML's, save for DEL."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _list(values: Sequence[Any]) -> str:
    """Return a list, a line a row where its members are lists themselves."""
    parts = [_value(v) for v in values]
    if any(isinstance(v, Sequence) and not isinstance(v, str) for v in values):
        return "[\n" + "".join(f"  {part},\n" for part in parts) + "]"
    return f"[{', '.join(parts)}]"
