"""The wire's page, made from what `describe` answers and from the types of the requests."""

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from docs.gen.events import COMMON, FIELDS
from docs.gen.tables import plain, table, words
from legato.config.load import load, shipped
from legato.daemon.status import describe
from legato.wire.requests import REQUESTS, STOP_LINE

HEAD = """\
# The wire

ZeroMQ and JSON, on loopback unless keys are configured. Three sockets:

| socket | type | default | for |
|---|---|---|---|
| requests | ROUTER | `tcp://127.0.0.1:5760` | JSON-RPC 2.0, one frame; for REQ and DEALER |
| events | XPUB | `tcp://127.0.0.1:5761` | two frames: topic and JSON |
| stop | ROUTER | `tcp://127.0.0.1:5762` | `stop`, `estop` and `ping` alone |

A job's method answers at once with its session; `wait` tells how it ended. The daemon's own
`describe` says the same as this page, and is what this page is made from.

A request has at most 64 kB. A longer one is answered with `invalid_request` and the limit, up to
256 kB; of what is longer still nothing is taken in, and its connection ends.

```python
import zmq

line = zmq.Context.instance().socket(zmq.REQ)
line.connect("tcp://127.0.0.1:5760")
line.send_json({"jsonrpc": "2.0", "id": 1, "method": "status"})
print(line.recv_json()["result"]["state"])
```
"""
ACTING = """\
Methods that act take two more parameters. `expires_at`: in the daemon's monotonic s, which `ping`
tells in `now`; begun no later, else `expired`. `lease`: the token, while the cell is leased;
without it another's request is `busy`. Nobody needs a lease to stop.
"""
STOPPING = """\
A socket and thread of its own, for these alone. It answers in every state, during a blocked
driver call and while the daemon is busy with a disk. A stop's answer has the times `received`,
`commanded` and `confirmed` in monotonic s, and in `wall` the same for people. `confirmed` is null
until the motion on its way has ended and the driver has said so; `reason` says why. `timeout_s` is
how long the answer waits for that; `ping` tells of the last stop as it stands since. `state` is
where the stop takes the cell. A job that was sent before a stop and not yet begun is refused as
`expired`.
"""
ANSWERS = """\
`ok` means accepted. It may still be refused for what no state tells of: `precondition`,
`unavailable`, `expired`, `not_authorised`, and `busy` for a lease. Which jobs an idle cell would
refuse for want of a device, a picture, a reference or a calibration stands in `status` under
`lacking`, with reason and hint.
"""
CAMPAIGNS = """\
`campaign` repeats a job until `count` repetitions have begun, until `for_s` of the cell's time are
over, or until a time of day. `every_s` is from start to start; a repetition that takes longer is
followed by the next at once. Between two repetitions the state is `idle`, and still the campaign's:

| asked meanwhile | answer |
|---|---|
| stop, on either line | ok in every state: no further repetition begins |
| estop, on either line | ok: the campaign has ended |
| `end_campaign` | ok: the repetition under way ends by itself, and is the last |
| a job, `campaign`, `reference` | `busy` |
| `reset` in `fault` | ok: a person is there, the campaign has ended |
| `pause`, `resume` | as for any job; a paused repetition is waited for |
| the daemon's end, a daemon frozen for 30 s | the campaign is `interrupted` |

A fault of the camera (`camera_lost`, `camera_stale`) is reset by itself at most `resets` times, the
first 5 s of the cell's time later, then after twice as long each, and the next repetition begins
with a new picture. Nothing is reset after the last repetition. Every other fault ends the campaign
and stays latched. So does a repetition that would be refused to its operator: the arm is not
referenced, the disk is full, another has the lease, or the lease with a deadman under which it was
begun has ended. A repetition whose calibration is rejected counts as failed, and the campaign goes
on. `campaigns` has the summaries, and `state_dir/campaigns/` keeps them.
"""
EVENTS = """\
Every event has the fields `boot` (new at each start of the daemon), `seq` (without a gap within a
boot), `t` (the cell's clock, s) and `session` (its id, or null). A new subscriber gets the latest
event of each topic at once. `events_since` replays what was missed. A subscriber that is too slow
loses events, sees it by `seq`, and slows nobody.
"""


def page() -> str:
    """Return the page for a cell with the shipped stations."""
    config = load(shipped("sim.toml"), need_intrinsics=False).config
    return reference(config.leg.stations_mm)


def reference(stations: Iterable[float]) -> str:
    """Return the page for a cell with these stations (mm)."""
    told = describe(stations)
    able = told["roles"]
    parts = [
        HEAD,
        "## Methods\n",
        _methods(told["methods"], able),
        ACTING,
        *(_method(name, told["methods"][name], REQUESTS[name].__doc__) for name in REQUESTS),
        "## The stop line\n",
        STOPPING,
        _methods(told["stop_line"], None),
        *(f"**{name}**: " + _parameters(told["stop_line"][name]["params"]) + "\n"
          for name in STOP_LINE if _properties(told["stop_line"][name]["params"])),
        "## What is answered in which state\n",
        ANSWERS,
        _answers(told["table"], told["states"]),
        "## Refusals by state\n",
        _refusals(told["table"]),
        "## Campaigns\n",
        CAMPAIGNS,
        "## Errors\n",
        "Every refusal has `data: {reason, state, hint}`.\n",
        table(("name", "code"), ((f"`{n}`", c) for n, c in told["errors"].items())),
        "## Events\n",
        EVENTS,
        *(_topic(topic) for topic in told["topics"]),
        "## States\n",
        ":::{drawn} states\nThe states, and the ways between them; every busy state can also "
        "end in `stopping` or `fault`.\n:::\n",
        _deadlines(told["deadlines_s"]),
        "## Outcomes\n",
        f"A session ends as one of {words(told['outcomes'])}. Causes of faults have [a page of "
        "their own](faults.md).\n",
    ]  # fmt: skip
    return "\n".join(parts)


def _methods(methods: Mapping[str, Any], roles: Mapping[str, Any] | None) -> str:
    """Return the list of methods, with links where they have sections."""
    rows = []
    for name, method in methods.items():
        row = [f"[`{name}`](#{name})" if roles else f"`{name}`", plain(method["does"])]
        row.append(words(_properties(method["params"])))
        if roles:
            row.append(", ".join(r for r, able in roles.items() if name in able))
        rows.append(row)
    head = ("method", "does", "parameters", "roles")
    return table(head if roles else head[:3], rows)


def _method(name: str, method: Mapping[str, Any], text: str | None) -> str:
    """Return a method's section: what it does in full, and its parameters."""
    more = "\n".join((text or "").splitlines()[1:]).strip()
    said = f"{method['does']}\n\n{more}".strip()
    lines = [" ".join(part.split()) for part in said.split("\n\n")]
    return (
        f"### {name}\n\n"
        + "\n\n".join(plain(p) for p in lines)
        + ("\n\n" + _parameters(method["params"]))
    )


def _properties(schema: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the parameters of a method's JSON Schema."""
    name = schema["$ref"].rpartition("/")[2]
    found: Mapping[str, Any] = schema["$defs"][name].get("properties", {})
    return found


def _parameters(schema: Mapping[str, Any]) -> str:
    """Return a method's parameters with type, limits and default."""
    name = schema["$ref"].rpartition("/")[2]
    needed = schema["$defs"][name].get("required", ())
    rows = []
    for parameter, kind in _properties(schema).items():
        default = "must be given" if parameter in needed else f"`{_json(kind.get('default'))}`"
        rows.append((f"`{parameter}`", _kind(kind, schema["$defs"]), default))
    return table(("parameter", "value", "default"), rows) if rows else ""


def _kind(schema: Mapping[str, Any], known: Mapping[str, Any]) -> str:
    """Return a JSON Schema in words."""
    if "anyOf" in schema:
        return " or ".join(_kind(s, known) for s in schema["anyOf"])
    if "$ref" in schema:
        return _kind(known[schema["$ref"].rpartition("/")[2]], known)
    if "enum" in schema:
        return words(f'"{v}"' for v in schema["enum"])
    kind = str(schema.get("type", "any"))
    if kind == "array":
        items = schema.get("prefixItems") or [schema.get("items") or {}]
        first = _kind(items[0], known)
        return f"{len(items)} of {first}" if "prefixItems" in schema else f"list of {first}"
    if kind == "object" and isinstance(schema.get("additionalProperties"), Mapping):
        return f"object of {_kind(schema['additionalProperties'], known)}"
    return " ".join([kind, *_limits(schema)])


def _limits(schema: Mapping[str, Any]) -> Iterator[str]:
    signs = {"minimum": "≥", "maximum": "≤", "exclusiveMinimum": "&gt;", "exclusiveMaximum": "&lt;"}
    told = [f"{sign} {schema[name]:g}" for name, sign in signs.items() if name in schema]
    if told:
        yield f"({', '.join(told)})"


def _json(value: object) -> str:
    return json.dumps(value)


def _answers(rows: Iterable[Mapping[str, str]], states: Iterable[str]) -> str:
    """Return the answers, a line a method and a column a state; massage states share one."""
    answers = {(r["method"], r["state"]): r["answer"] for r in rows}
    shown = [s for s in states if not s.startswith("massage_")]
    passes = [s for s in states if s.startswith("massage_")]
    shown.insert(shown.index("move_home") + 1, passes[0])
    methods = dict.fromkeys(method for method, _ in answers)
    for method in methods:
        if len({answers[method, s] for s in passes}) != 1:
            raise ValueError(f"{method} is not answered alike in every massage state")
    head = ["method", *("massage_N" if s == passes[0] else s for s in shown)]
    body = ([f"`{m}`", *(_short(answers[m, s]) for s in shown)] for m in methods)
    return table(head, body)


def _short(answer: str) -> str:
    return "ok" if answer == "accepted" else answer


def _refusals(rows: Iterable[Mapping[str, str]]) -> str:
    """Return why, and what to do, once for each different text."""
    found: dict[tuple[str, str, str], None] = {}
    for row in rows:
        if row["answer"] != "accepted":
            why = row["reason"].removeprefix(row["method"]).replace(row["state"], "STATE")
            found[row["answer"], f"METHOD{why}", row["hint"]] = None
    return table(("error", "reason", "hint"), found)


def _topic(topic: str) -> str:
    """Return a topic's section with the fields that its events have beside the common ones."""
    told = FIELDS[topic]
    rows = ((f"`{name}`", plain(text)) for name, text in told.fields.items() if name not in COMMON)
    return f"### `{topic}`\n\n{told.when}\n\n" + table(("field", "is"), rows)


def _deadlines(deadlines: Mapping[str, float | None]) -> str:
    rows = ((f"`{s}`", "none" if d is None else f"{d:g} s") for s, d in deadlines.items())
    return table(("state", "ends in fault after"), rows)
