"""The wire's reference for people, made from what `describe` answers.

`python -m legato.daemon.reference` prints docs/reference/table.md for the shipped cell.
"""

import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from legato.daemon.status import describe

HEAD = """\
# The line: methods, states and answers

Made by `python -m legato.daemon.reference > docs/reference/table.md` from what the daemon answers
to `describe`; a test holds this file to it. Requests are JSON-RPC 2.0, one frame, one request.
"""
STOP_LINE = """\
## The stop line

A socket and thread of its own, for these three alone. It answers in every state, during a blocked
driver call and while the daemon is busy with a disk. A stop's answer has the times `received`,
`commanded` and `confirmed` in monotonic s, and in `wall` the same for people. `confirmed` is null
until the motion on its way has ended and the driver has said so; `reason` says why. `timeout_s` is
how long the answer waits for that; `ping` tells of the last stop as it stands since. `state` is
where the stop takes the cell. A job that was sent before a stop and not yet begun is refused as
`expired`.
"""
ACTING = """\
Methods that act take two more parameters. `expires_at`: in the daemon's monotonic s, which `ping`
tells in `now`; begun no later, else `expired`. `lease`: the token, while the cell is leased;
without it another's request is `busy`. Nobody needs a lease to stop.
"""
TABLE = """\
## What is answered in which state

`ok` means accepted: it may still be refused for what no state tells of (`precondition`,
`unavailable`, `expired`, `not_authorised`, `busy` for a lease).
"""


def reference(stations: Iterable[float]) -> str:
    """Return the whole page for a cell with these stations (mm)."""
    told = describe(stations)
    parts = [
        HEAD,
        "## Methods\n\n" + _methods(told["methods"], told["roles"]),
        ACTING,
        STOP_LINE,
        _methods(told["stop_line"], None),
        TABLE,
        _table(told["table"], told["states"]),
        "## Refusals by state\n\n" + _refusals(told["table"]),
        "## Errors\n\n" + _rows(("name", "code"), told["errors"].items()),
        "## States and their deadlines\n\n" + _deadlines(told["deadlines_s"]),
        "## Words\n",
        f"Outcomes: {_list(told['outcomes'])}.\n",
        f"Topics of events: {_list(told['topics'])}.\n",
        f"Causes of faults: {_list(told['fault_causes'])}.\n",
    ]
    return "\n".join(parts)


def _methods(methods: Mapping[str, Any], roles: Mapping[str, Any] | None) -> str:
    head = ("method", "does", "parameters", "roles") if roles else ("method", "does", "parameters")
    rows = []
    for name, method in methods.items():
        row = [f"`{name}`", method["does"], _parameters(method["params"])]
        if roles:
            row.append(", ".join(r for r, able in roles.items() if name in able))
        rows.append(row)
    return _rows(head, rows)


def _parameters(schema: Mapping[str, Any]) -> str:
    """Return the parameters' names, those that must be given marked."""
    (kind,) = schema["$defs"].values()
    needed = kind.get("required", ())
    return ", ".join(f"`{p}`" + (" (needed)" if p in needed else "") for p in kind["properties"])


def _table(rows: Iterable[Mapping[str, str]], states: Iterable[str]) -> str:
    """Return the answers, a line a method and a column a state; massage states share one."""
    answers = {(r["method"], r["state"]): r["answer"] for r in rows}
    shown = [s for s in states if not s.startswith("massage_")]
    passes = [s for s in states if s.startswith("massage_")]
    shown.insert(shown.index("move_home") + 1, passes[0])
    methods = dict.fromkeys(method for method, _ in answers)
    for method in methods:
        assert len({answers[method, s] for s in passes}) == 1, "massage states answer alike"
    head = ["", *("massage_N" if s == passes[0] else s for s in shown)]
    body = ([f"`{m}`", *(_short(answers[m, s]) for s in shown)] for m in methods)
    return _rows(head, body)


def _short(answer: str) -> str:
    return "ok" if answer == "accepted" else answer


def _refusals(rows: Iterable[Mapping[str, str]]) -> str:
    """Return why, and what to do, once for each different text."""
    found: dict[tuple[str, str, str], None] = {}
    for row in rows:
        if row["answer"] != "accepted":
            why = row["reason"].removeprefix(row["method"]).replace(row["state"], "STATE")
            found[row["answer"], f"METHOD{why}", row["hint"]] = None
    return _rows(("error", "reason", "hint"), found)


def _deadlines(deadlines: Mapping[str, float | None]) -> str:
    rows = ((f"`{s}`", "none" if d is None else f"{d:g} s") for s, d in deadlines.items())
    return _rows(("state", "ends in fault after"), rows)


def _list(words: Iterable[str]) -> str:
    return ", ".join(f"`{w}`" for w in words)


def _rows(head: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return a table in Markdown."""

    def lines() -> Iterator[str]:
        names = list(head)
        yield "| " + " | ".join(names) + " |"
        yield "|" + "---|" * len(names)
        for row in rows:
            yield "| " + " | ".join(str(cell) for cell in row) + " |"

    return "\n".join(lines()) + "\n"


if __name__ == "__main__":
    from legato.config.load import load, shipped

    cell = load(shipped("sim.toml"), need_intrinsics=False)
    sys.stdout.write(reference(cell.config.leg.stations_mm))
