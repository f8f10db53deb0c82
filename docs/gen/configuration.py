"""Every key of the configuration: type and limits from the schema, meaning from etc/cell.toml.

etc/cell.toml explains every key, and a test holds it to that. A key that it does not have is
explained by its docstring in the schema.
"""

import ast
import inspect as python
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
from msgspec import NODEFAULT, inspect

from docs.gen.tables import plain, table
from legato.config.expected import describe
from legato.config.schema import Config

CELL = Path(__file__).resolve().parents[2] / "etc" / "cell.toml"
TABLE = re.compile(r"^\[(?P<name>[\w.]+)\]\s*(?:#\s*(?P<text>.*))?$")
KEY = re.compile(r"^(?:# )?(?P<name>\w+) = (?P<rest>.*)$")
MORE = re.compile(r"^\s+#\s?(?P<text>.*)$")
FAR = 100_000  # limits so large only keep slips of the pen out of sums
UNIT = re.compile(r"(mm|mm/s|deg|s|px|px/mm|rad|N/mm|MB|half-steps/s)\b[,. ]")
DEFAULT = re.compile(r"\s*\b(?:No default|Default|Default, likewise)\.(?=\s|$)")
HEAD = """\
# Configuration

One TOML file. A key that is left out has its default. An unknown key, a wrong type or a value out
of its limits is refused with file, key, value and what was expected. Relative paths are relative
to the file; `~` is the user's home. `etc/cell.toml` is a real cell's file with every key in it,
`etc/sim.toml` the simulated one's. `legato check --config FILE` looks a file over.

A number's limits stand in brackets; limits that only catch slips of the pen are left out.
*[inferred]* marks a default that no source states: measure it at your arm before you trust it.

This page is made from the schema and from `etc/cell.toml`.
"""


@dataclass
class Explained:
    """What etc/cell.toml says of its tables, keys and faults."""

    tables: dict[str, list[str]] = field(default_factory=dict)
    keys: dict[str, str] = field(default_factory=dict)
    tail: list[str] = field(default_factory=list)


def page() -> str:
    """Return the page."""
    said = explained(CELL.read_text(encoding="utf-8"))
    parts = [HEAD]
    for name, struct in tables(Config):
        parts.append(f"## `[{name}]`\n")
        parts.append(_prose(said, name, struct))
        rows = (_row(said, name, f, struct) for f in fields_of(struct))
        parts.append(table(("key", "value", "default", "meaning"), (r for r in rows if r)))
    parts.append(_faults(said))
    return "\n".join(parts)


def fields_of(struct: type) -> tuple[inspect.Field, ...]:
    """Return a table's keys as msgspec sees them."""
    found = inspect.type_info(struct)
    assert isinstance(found, inspect.StructType)
    return found.fields


def tables(struct: type, name: str = "") -> Iterator[tuple[str, type]]:
    """Yield every table's name and type, the outer before the inner."""
    for f in fields_of(struct):
        inner = _struct(f.type)
        if inner is not None and not _inline(inner):
            place = f"{name}.{f.encode_name}".lstrip(".")
            yield place, inner
            yield from tables(inner, place)


def explained(text: str) -> Explained:
    """Read the comments of a configuration file."""
    said, place, last, waiting = Explained(), "", None, list[str]()
    for line in text.splitlines():
        if found := TABLE.match(line):
            place, last, waiting = found["name"], None, []
            said.tables[place] = [found["text"]] if found["text"] else []
        elif (found := MORE.match(line)) and waiting == []:
            _add(said, place, last, found["text"])
        elif (found := KEY.match(line)) and (not line.startswith("#") or "#" in found["rest"]):
            last = f"{place}.{found['name']}"
            own = _comment(found["rest"])
            lead = " ".join(waiting)
            if own or last not in said.keys:
                said.keys[last] = own or lead
            if own and lead:
                said.tables[place].append(f"\n\n{lead}")
            waiting = []
        elif line.startswith("#") and place:
            waiting.append(line.removeprefix("#").strip())
            if place == "sim":
                said.tail.append(line.removeprefix("# "))
        elif not line.strip():
            waiting = []
    return said


def _add(said: Explained, place: str, last: str | None, text: str) -> None:
    """Append a comment that goes on to what it belongs to."""
    if last is None:
        said.tables[place].append(text)
    else:
        said.keys[last] = f"{said.keys[last]} {text}".strip()


def _comment(rest: str) -> str:
    """Return the comment behind a value; a `#` inside quotes is none."""
    quoted = False
    for at, sign in enumerate(rest):
        quoted ^= sign == '"'
        if sign == "#" and not quoted:
            return rest[at + 1 :].strip()
    return ""


def _prose(said: Explained, name: str, struct: type) -> str:
    """Return what is said of a table as a whole."""
    said_of = [t for t in said.tables.get(name, ()) if len(t.split()) > 1]
    text = " ".join(said_of).strip() or (struct.__doc__ or "").strip()
    parts = (" ".join(part.split()) for part in text.split("\n\n"))
    return "\n\n".join(plain(_begun(p)) for p in parts) + "\n"


def _row(said: Explained, name: str, f: inspect.Field, owner: type) -> tuple[str, ...] | None:
    """Return a key's row, or None for a table that has its own section."""
    inner = _struct(f.type)
    if inner is not None and not _inline(inner):
        return None
    key = f"{name}.{f.encode_name}"
    text = said.keys.get(key) or docstrings(owner).get(f.encode_name, "")
    text = DEFAULT.sub("", text).strip()
    return f"`{f.encode_name}`", _wanted(f.type), _default(f), plain(_begun(text))


def _begun(text: str) -> str:
    """Return text with a capital, unless it begins with a unit."""
    return text if UNIT.match(text) else text[:1].upper() + text[1:]


def _wanted(wanted: inspect.Type) -> str:
    inner = _struct(wanted)
    if inner is not None:
        keys = ", ".join(f"`{f.encode_name}`" for f in fields_of(inner))
        return f"a table of {keys}"
    if key := getattr(wanted, "item_type", None):
        item = _struct(key)
        if item is not None:
            return "a list of tables, see [below](#simfaults)"
    return _words(wanted)


def _words(wanted: inspect.Type) -> str:
    """Return in few words what a type accepts."""
    match wanted:
        case inspect.LiteralType(values=values):
            return ", ".join(f"`{_toml(v)}`" for v in values)
        case inspect.IntType() | inspect.FloatType():
            kind = "whole number" if isinstance(wanted, inspect.IntType) else "number"
            return " ".join([kind, _limits(wanted)]).strip()
        case inspect.TupleType(item_types=[first, *_] as items):
            return f"{len(items)} of {_words(first)}"
        case inspect.VarTupleType(item_type=item) | inspect.ListType(item_type=item):
            return f"list of {_words(item)}"
        case inspect.UnionType(types=types):
            return " or ".join(_words(t) for t in types if not isinstance(t, inspect.NoneType))
        case inspect.StrType():
            return "text"
        case _:
            return plain(describe(wanted))


def _limits(wanted: inspect.IntType | inspect.FloatType) -> str:
    """Return a number's limits; what is far beyond any cell is left out."""
    signs = ((wanted.gt, ">"), (wanted.ge, "≥"), (wanted.lt, "<"), (wanted.le, "≤"))
    told = [f"{sign} {most:g}" for most, sign in signs if most is not None and abs(most) < FAR]
    return "(" + ", ".join(told).replace("<", "&lt;").replace(">", "&gt;") + ")" if told else ""


def _default(f: inspect.Field) -> str:
    """Return a default as it would stand in the file."""
    if f.default is not NODEFAULT:
        value = f.default
    elif f.default_factory is not NODEFAULT:
        value = f.default_factory()
    else:
        return "must be given"
    if value is None:
        return "none"
    if isinstance(value, dict) and len(value) > 4:
        return "see the text"
    if isinstance(value, msgspec.Struct):
        return "see the text"
    return f"`{_toml(value)}`"


def _toml(value: Any) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            return f'"{value}"'
        case tuple() | list():
            return "[" + ", ".join(_toml(v) for v in value) + "]"
        case float():
            return f"{value:.6g}" if value != int(value) or abs(value) >= 1e6 else f"{value:.1f}"
        case _:
            return str(value)


def _faults(said: Explained) -> str:
    """Return the section of the faults that can be put into a cell."""
    from legato.drivers.faulty.settings import FaultSettings

    texts = docstrings(FaultSettings)
    rows = []
    for f in fields_of(FaultSettings):
        text = texts.get(f.encode_name, "")
        rows.append((f"`{f.encode_name}`", _wanted(f.type), _default(f), plain(text)))
    listed = "\n".join(said.tail).strip("\n")
    return (
        "## `[[sim.faults]]`\n\n"
        f"{(FaultSettings.__doc__ or '').strip()}\n\n"
        + table(("key", "value", "default", "meaning"), rows)
        + f"\n```text\n{listed}\n```\n"
    )


def docstrings(struct: type) -> dict[str, str]:
    """Return the text under each field of a class, its parents' too."""
    found: dict[str, str] = {}
    for kind in reversed(struct.__mro__):
        if kind.__module__.startswith("legato"):
            found |= _under(ast.parse(python.getsource(kind)).body[0])
    return found


def _under(node: ast.AST) -> dict[str, str]:
    found, last = {}, None
    for item in getattr(node, "body", ()):
        if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name):
            last = item.target.id
        elif isinstance(item, ast.Assign) and isinstance(item.targets[0], ast.Name):
            last = item.targets[0].id
        elif isinstance(item, ast.Expr) and isinstance(item.value, ast.Constant) and last:
            found[last], last = " ".join(str(item.value.value).split()), None
        else:
            last = None
    return found


def _struct(wanted: inspect.Type) -> type | None:
    """Return the struct that a type is, or may be."""
    if isinstance(wanted, inspect.UnionType):
        return next((s for s in map(_struct, wanted.types) if s is not None), None)
    return wanted.cls if isinstance(wanted, inspect.StructType) else None


def _inline(struct: type) -> bool:
    """Say whether a table is written on one line, as a value."""
    return struct.__name__ == "CurveTable"
