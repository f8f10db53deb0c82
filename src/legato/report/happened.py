"""What happened in a session, for people: its events and faults in words, evidence as lists."""

import re
from collections.abc import Mapping
from typing import Any

from legato.records.record import SessionRecord
from legato.report.clock import day, time_of_day
from legato.report.facts import Row, told
from legato.report.lines import line_of

MOST_EVENTS = 400  # a session has some 30, one of many strokes a few hundred
UNITS = ("mm", "deg", "px", "s", "rad")  # as keys end, after an underscore
NAMED = re.compile(r"<[\w.]+: '([^']*)'>")  # one of an enumeration, in the program's own words
NONE = re.compile(r"(?:^|, )\w+=None\b")
INNER = re.compile(r"=[A-Z]\w*\(")
CALL = re.compile(r"([A-Z]\w*)\((.*)", re.DOTALL)  # an effect, as a fault's evidence has it
MOVE = re.compile(r"Move\(move=StepMove\(steps=\(([^)]*)\)")
WHY = re.compile(r"\bwhy=<Why\.\w+: '(\w+)'>")
STATION = re.compile(r"\bstation=([\d.]+)")
MEANT = {"residuals": "px"}  # units that no key tells
DECIMALS = {"mm": 2, "deg": 2, "px": 3}


def faults(record: SessionRecord) -> list[Row]:
    """Return every fault of the session with its evidence, the one that ended it first."""
    found = []
    for event in reversed(record.of_kind("fault")):
        evidence = event["data"].get("evidence")
        found.append(
            {
                **{key: event["data"].get(key) for key in ("cause", "text", "hint")},
                "evidence": listed(evidence) if isinstance(evidence, dict) else [],
                "wall": day(event.get("wall")) or event.get("wall"),
            }
        )
    return found


def events(record: SessionRecord) -> list[Row]:
    """Return the latest events, MOST_EVENTS at most: number, time of day in UTC, kind, words."""
    return [
        {
            "seq": event["seq"],
            "wall": time_of_day(event.get("wall")) or "unknown",
            "kind": event["kind"],
            "text": line_of(event["kind"], event.get("data") or {}),
        }
        for event in record.events[-MOST_EVENTS:]
    ]


def listed(values: Mapping[str, Any]) -> list[tuple[str, list[str]]]:
    """Return nested data for people: each name with its lines, units behind the figures."""
    return _listed(values, "")


def _listed(values: Mapping[str, Any], unit: str) -> list[tuple[str, list[str]]]:
    """Return the same, `unit` being that of figures whose own key names none."""
    named = [(*_name(key), value) for key, value in values.items()]
    return [(words, _lined(value, own or unit)) for words, own, value in named]


def _lined(value: Any, unit: str) -> list[str]:
    """Return a value as lines: one for each part of a table, and for each thing in a list."""
    if isinstance(value, dict):
        pairs = [(name, ", ".join(lines)) for name, lines in _listed(value, unit)]
        return [f"{name}: {words}" for name, words in pairs] or ["none"]
    if isinstance(value, list) and not all(isinstance(v, int | float) for v in value):
        return ["; ".join(_lined(v, "")) for v in value]
    if isinstance(value, list):
        figures = ", ".join(_figure(v, unit, more=1) for v in value)
        return [f"{figures} {unit}".strip() if value else "none"]
    if isinstance(value, bool):
        return ["yes" if value else "no"]
    if isinstance(value, str):
        return [effect(value)]
    words = _figure(value, unit)
    return [f"{words} {unit}" if unit and value is not None else words]


def _figure(value: Any, unit: str, more: int = 0) -> str:
    """Return a figure with no more decimals than its unit is worth, or `more`."""
    if isinstance(value, float) and unit in DECIMALS:
        return f"{value:.{min(DECIMALS[unit] + more, 3)}f}".rstrip("0").rstrip(".")
    return told(value)


def _name(key: str) -> tuple[str, str]:
    """Return a key as words, and the unit that it ends with."""
    words, _, unit = key.rpartition("_")
    found = (words, unit) if words and unit in UNITS else (key, MEANT.get(key, ""))
    return found[0].replace("_", " "), found[1]


def effect(text: str) -> str:
    """Return an effect as words, `Grab(name='verify')` as "Grab, name verify"; others unchanged.

    A motion is told as "descend at 7 mm: steps 0 4 2 0 0 2", half-steps of the six motors.
    """
    if steps := MOVE.match(text):
        why, station = WHY.search(text), STATION.search(text)
        at = f" at {float(station[1]):g} mm" if station else ""
        return f"{why[1] if why else 'motion'}{at}: steps {steps[1].replace(',', '')}"
    call = CALL.fullmatch(text)
    if call is None:
        return text
    words = NONE.sub("", NAMED.sub(r"\1", call[2])).replace("'", "")
    words = words.removesuffix(")") if words.endswith(")") else f"{words} ..."  # broken off
    words = INNER.sub(" (", words).replace("=", " ").translate({ord("{"): None, ord("}"): None})
    return f"{call[1]}, {words}" if words else call[1]
