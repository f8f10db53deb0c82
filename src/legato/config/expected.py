"""Turns a refusal of msgspec into key, value and expectation in words for people."""

import difflib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
from msgspec import inspect

from legato.config.errors import ABSENT, ConfigError

PLACE = re.compile(r"^(?P<text>.*?)(?: - at `\$(?P<path>.*)`)?$", re.DOTALL)
UNKNOWN = re.compile(r"unknown field `(.*)`", re.DOTALL)
MISSING = re.compile(r"missing required field `(.*)`", re.DOTALL)
TOKEN = re.compile(r"\.(?P<name>[^.\[]+)|\[(?P<index>\d+)\]|\[(?P<any>\.\.\.)\]")


def refusal(error: msgspec.ValidationError, data: Any, of: type, file: Path) -> ConfigError:
    """Return the ConfigError of a decoding of `data` as `of` that failed."""
    match = PLACE.match(str(error))
    text, path = (match["text"], match["path"] or "") if match else (str(error), "")
    tokens = _tokens(path, data, of)
    key = "".join(f"[{t}]" if isinstance(t, int) else f".{t}" for t in tokens).lstrip(".")
    wanted = _type_at(tokens, of)
    value = _value_at(tokens, data)
    if found := UNKNOWN.search(text):
        return _unknown(file, key, found[1], value, wanted)
    if found := MISSING.search(text):
        return ConfigError(file, f"{key}.{found[1]}".lstrip("."), ABSENT, "this key")
    return ConfigError(file, key, value, describe(wanted))


def _unknown(file: Path, table: str, name: str, value: Any, wanted: inspect.Type) -> ConfigError:
    """Return the error of a key that the schema does not have, with the nearest that it has."""
    known = [f.encode_name for f in getattr(wanted, "fields", ())]
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    place = f"[{table}]" if table else "the top of the file"
    expected = f"a key of {place}: {', '.join(known)}"
    hint = f"did you mean {' or '.join(near)}?" if near else ""
    given = value.get(name, ABSENT) if isinstance(value, Mapping) else ABSENT
    return ConfigError(file, f"{table}.{name}".lstrip("."), given, expected, hint)


def _tokens(path: str, data: Any, of: type) -> list[str | int]:
    """Return the steps of a msgspec path; `[...]` becomes the first key that is refused alone."""
    tokens: list[str | int] = []
    for match in TOKEN.finditer(path):
        if match["name"] is not None:
            tokens.append(match["name"])
        elif match["index"] is not None:
            tokens.append(int(match["index"]))
        else:
            tokens.append(_refused_key(tokens, data, of))
    return tokens


def _refused_key(tokens: list[str | int], data: Any, of: type) -> str:
    """Return the key of the table at `tokens` whose value is refused when it stands alone."""
    table = _value_at(tokens, data)
    for key, value in table.items() if isinstance(table, Mapping) else ():
        alone: Any = {key: value}
        for token in reversed(tokens):
            alone = {token: alone}
        try:
            msgspec.convert(alone, of, strict=True)
        except msgspec.ValidationError as error:
            if "[...]" in str(error):
                return str(key)
    return "..."


def _value_at(tokens: list[str | int], data: Any) -> Any:
    """Return what stands in `data` at `tokens`, or ABSENT."""
    for token in tokens:
        try:
            data = data[token]
        except (KeyError, IndexError, TypeError):
            return ABSENT
    return data


def _type_at(tokens: list[str | int], of: type) -> inspect.Type:
    """Return the schema's type at `tokens`."""
    wanted = inspect.type_info(of)
    for token in tokens:
        wanted = _step(_table_of(wanted), token)
    return wanted


def _table_of(wanted: inspect.Type) -> inspect.Type:
    """Return a union's member that has parts, or the type itself."""
    if isinstance(wanted, inspect.UnionType):
        parts = [t for t in wanted.types if not isinstance(t, inspect.NoneType)]
        return parts[0] if parts else wanted
    return wanted


def _step(wanted: inspect.Type, token: str | int) -> inspect.Type:
    """Return the type of one part of a table or list."""
    if isinstance(wanted, inspect.StructType):
        found = [f.type for f in wanted.fields if f.encode_name == token]
        return found[0] if found else inspect.AnyType()
    if isinstance(wanted, inspect.DictType):
        return wanted.value_type
    if isinstance(wanted, inspect.TupleType) and isinstance(token, int):
        return wanted.item_types[min(token, len(wanted.item_types) - 1)]
    if isinstance(wanted, inspect.VarTupleType | inspect.ListType):
        return wanted.item_type
    return inspect.AnyType()


def describe(wanted: inspect.Type) -> str:
    """Return in words what a type accepts."""
    match wanted:
        case inspect.LiteralType():
            return f"one of {', '.join(repr(v) for v in wanted.values)}"
        case inspect.BoolType():
            return "true or false"
        case inspect.IntType():
            return "a whole number" + _range(wanted)
        case inspect.FloatType():
            return "a number" + _range(wanted)
        case inspect.StrType():
            return "a text in quotes" + (" (not empty)" if wanted.pattern else "")
        case inspect.TupleType():
            return f"a list of {len(wanted.item_types)}, each {describe(wanted.item_types[0])}"
        case inspect.VarTupleType() | inspect.ListType():
            least = f"at least {wanted.min_length}, " if wanted.min_length else ""
            most = f"at most {wanted.max_length}, " if wanted.max_length else ""
            return f"a list of {least}{most}each {describe(wanted.item_type)}"
        case inspect.DictType():
            most = f" of at most {wanted.max_length} keys" if wanted.max_length else ""
            return f"a table{most}"
        case inspect.StructType():
            return "a table"
        case inspect.UnionType():
            parts = [t for t in wanted.types if not isinstance(t, inspect.NoneType)]
            return " or ".join(describe(t) for t in parts)
        case _:
            return "another value"


def _range(wanted: inspect.IntType | inspect.FloatType) -> str:
    """Return a number's limits in words."""
    limits = [
        (wanted.gt, "above"),
        (wanted.ge, "at least"),
        (wanted.lt, "below"),
        (wanted.le, "at most"),
    ]
    parts = [f"{word} {limit:.12g}" for limit, word in limits if limit is not None]
    return f" {' and '.join(parts)}" if parts else ""
