"""Every cause of a fault: its meaning, and what the code says and advises wherever it raises it."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from docs.gen.configuration import docstrings
from docs.gen.tables import plain, table
from legato.hal.faults import Cause

SOURCE = Path(__file__).resolve().parents[2] / "src" / "legato"
UNKNOWN = "…"
# Errors of the layers below, and the cause that each becomes.
BECOMES = {
    "CalibrationError": "CALIBRATION_REJECTED",
    "MarksNotFound": "MARKS_NOT_FOUND",
    "RecordError": "DISK",
}
HEAD = """\
# Faults

A fault is latched: the cell stays in state `fault` with its cause, text, hint and evidence until
somebody sends `reset`. Causes are a fixed list, part of the wire. [Deal with a
fault](../howto/faults.md) says how to go on.

The texts below are read from the code that raises them; `{…}` stands for a figure. A row without a
hint gets it from the device at that moment.
"""


@dataclass(frozen=True)
class Raised:
    """One place where the code names a cause: layer, text, hint."""

    cause: str
    layer: str
    text: str
    hint: str


def page() -> str:
    """Return the page."""
    meanings, places = docstrings(Cause), sorted(raised(), key=lambda r: (r.layer, r.text))
    parts = [HEAD]
    rows = ((f"[`{c}`](#{c})", plain(meanings.get(c.name, ""))) for c in Cause)
    parts.append(table(("cause", "means"), rows))
    for cause in Cause:
        parts.append(f"## `{cause}`\n\n{plain(meanings.get(cause.name, ''))}\n")
        mine = [r for r in places if r.cause == cause.name]
        if mine:
            told = ((plain(r.text), plain(r.hint)) for r in dict.fromkeys(mine))
            parts.append(table(("what is said", "what to do"), dict.fromkeys(told)))
    return "\n".join(parts)


def raised() -> Iterator[Raised]:
    """Yield every call in the code that gives a cause with its text."""
    for path in sorted(SOURCE.rglob("*.py")):
        layer = path.relative_to(SOURCE).parts[0]
        if layer in ("report", "replay", "web", "export"):
            continue
        text = path.read_text(encoding="utf-8")
        if not any(name in text for name in ("Cause.", *BECOMES)):
            continue
        for scope in ast.walk(ast.parse(text)):
            if isinstance(scope, ast.FunctionDef):
                yield from _in_function(scope, layer)


def _in_function(scope: ast.FunctionDef, layer: str) -> Iterator[Raised]:
    known = {
        node.targets[0].id: node.value
        for node in ast.walk(scope)
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    for node in ast.walk(scope):
        if not isinstance(node, ast.Call) or not node.args:
            continue
        name, said = _cause_of(node)
        if name is None:
            continue
        text, hint = (_told(said[i], known) if len(said) > i else "" for i in (0, 1))
        if text.strip(UNKNOWN) or hint.strip(UNKNOWN):
            yield Raised(name, layer, text, "" if hint == UNKNOWN else hint)


def _cause_of(call: ast.Call) -> tuple[str | None, list[ast.expr]]:
    """Return the cause that a call names, if any, and the arguments that tell of it."""
    match call:
        case ast.Call(args=[ast.Attribute(value=ast.Name(id="Cause"), attr=name), *said]):
            return name, said
        case ast.Call(func=ast.Name(id=name), args=said) if name in BECOMES:
            return BECOMES[name], said
        case _:
            return None, []


def _told(node: ast.expr, known: dict[str, ast.expr], depth: int = 0) -> str:
    """Return a string's text as it stands in the code, its figures as `{…}`."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=values):
            return "".join(
                _told(v, known, depth) if isinstance(v, ast.Constant) else "{…}" for v in values
            )
        case ast.Name(id=name) if name in known and depth < 3:
            return _told(known[name], known, depth + 1)
        case ast.Tuple(elts=[first]):
            return _told(first, known, depth)
        case ast.IfExp(body=body):
            return _told(body, known, depth)
        case ast.BinOp(left=left, right=right):
            return _told(left, known, depth) + _told(right, known, depth)
        case _:
            return UNKNOWN
