"""The shipped dashboard beside what a real daemon exposes after a run, a stop and a fault."""

import json
import re
import urllib.request
from collections import defaultdict
from pathlib import Path
from typing import Any

from prometheus_client.parser import text_string_to_metric_families

from legato.config.load import shipped
from tests.system.attacked import SHORT, attacked
from tests.system.line import Line

SELECTOR = re.compile(r"\b((?:legato|process)_[a-z_]+)(?:\{([^}]*)\})?")
MATCHER = re.compile(r'(\w+)(=~|=)"([^"]*)"')
GROUPED = re.compile(r"by \(([^)]*)\)")
SHOWN = re.compile(r"\{\{(\w+)\}\}")
UNITS = {"seconds": "s", "bytes": "bytes", "mm": "lengthmm"}
"""What an axis has for a metric that names its unit."""

Series = dict[str, list[dict[str, str]]]


def exposed(folder: Path) -> Series:
    """Return the labels of every series after a run, a stop and an emergency stop."""
    tables = {**SHORT, "metrics": {"listen": "127.0.0.1:0"}}
    with attacked(folder, tables, time_scale=400.0) as cell:
        line, stops = Line(cell.lines["requests"]), Line(cell.lines["stop"])
        try:
            assert line.outcome(line.do("run")["session"]) == "done"
            stops.do("stop")
            stops.do("estop")
            assert line.do("status")["fault"]["cause"] == "estop"
            with urllib.request.urlopen(cell.logged("metrics")[0]["url"], timeout=20.0) as page:
                text = page.read().decode()
        finally:
            line.close()
            stops.close()
    found: Series = defaultdict(list)
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            found[sample.name].append(dict(sample.labels))
    return found


def unanswered(query: str, legend: str, series: Series) -> list[str]:
    """Return what a query or its legend names that no series has."""
    wrong, labels = [], set[str]()
    for name, matchers in SELECTOR.findall(query):
        there = series.get(name, [])
        wrong += [] if there else [name]
        labels |= {label for one in there for label in one}
        for label, how, value in MATCHER.findall(matchers):
            values = value.split("|") if how == "=~" else [value]
            wrong += [
                f"{name}{{{label}={v}}}" for v in values if v not in {o.get(label) for o in there}
            ]
    grouped = [label.strip() for by in GROUPED.findall(query) for label in by.split(",")]
    wrong += [f"by {label}" for label in grouped if label not in labels]
    kept = set(grouped) if grouped else labels
    return wrong + [f"legend {label}" for label in SHOWN.findall(legend) if label not in kept]


def test_every_query_of_the_dashboard_has_an_answer_in_a_real_run(tmp_path: Path) -> None:
    """Metrics, the values that labels are asked for, and the labels that legends show."""
    series = exposed(tmp_path)
    dashboard = json.loads(shipped("grafana-legato.json").read_text(encoding="utf-8"))
    targets = [target for panel in dashboard["panels"] for target in panel["targets"]]
    wrong = {t["expr"]: unanswered(t["expr"], t["legendFormat"], series) for t in targets}
    assert {query: text for query, text in wrong.items() if text} == {}


def test_an_axis_has_the_unit_of_what_it_shows() -> None:
    """Seconds, bytes and rates are not drawn on one bare scale."""
    dashboard = json.loads(shipped("grafana-legato.json").read_text(encoding="utf-8"))
    for panel in dashboard["panels"]:
        if panel["type"] not in ("timeseries", "stat"):
            continue
        for target in panel["targets"]:
            assert unit_of(panel, target) in wanted(target["expr"]), (panel["title"], target)


def unit_of(panel: dict[str, Any], target: dict[str, Any]) -> str:
    """Return the unit in which a panel shows a target."""
    field = panel["fieldConfig"]
    for override in field["overrides"]:
        if override["matcher"] == {"id": "byName", "options": target["legendFormat"]}:
            for part in override["properties"]:
                if part["id"] == "unit":
                    return str(part["value"])
    return str(field["defaults"]["unit"])


def wanted(query: str) -> set[str]:
    """Return the units that fit a query."""
    name = SELECTOR.findall(query)[0][0].removesuffix("_bucket").removesuffix("_total")
    counts = name.endswith("_count") or "increase(" in query
    if query.startswith("rate(") and counts:
        return {"reqps"}
    unit = UNITS.get(name.rpartition("_")[2])
    if counts or unit is None or "calibration" in name:
        return {"short"}  # px and mm of the calibration share an axis; its legend names them
    return {unit, "decbytes"} if unit == "bytes" else {unit}
