"""The metrics' page: every figure that is counted, and a dashboard that asks for no other."""

import json
import re
import subprocess
import sys
import urllib.request
from typing import Any

import pytest

from legato.config.load import shipped
from legato.daemon.counts import Counts
from legato.daemon.metrics import Collector, MetricsServer, Now, registry_of
from legato.daemon.tally import Tally
from legato.hal.faults import Cause

STATES = ("idle", "capture", "massage_7", "fault")
METRIC = re.compile(r"\b(?:legato|process)_[a-z_]+\b")


def now(**changes: Any) -> Now:
    """Return what holds in a cell where all is well."""
    stops = {name: Tally() for name in ("commanded", "confirmed")}
    stops["commanded"].add(0.0003)
    values: dict[str, Any] = {
        "states": STATES,
        "state": "idle",
        "fault": None,
        "uptime_s": 12.5,
        "late_s": 0.001,
        "junk": 3,
        "free_mb": 1500.0,
        "worker_alive": True,
        "arm_connected": True,
        "arm_referenced": False,
        "camera_connected": True,
        "rms_px": 0.05,
        "sigma_mm": None,
        "stops": {name: tally.told() for name, tally in stops.items()},
    }
    return Now(**values | changes)


def counted() -> Counts:
    """Return the counts of a session that went through everything."""
    counts = Counts()
    for topic, data in (
        ("state", {"state": "capture"}),
        ("state", {"state": "fault"}),
        ("session", {"job": "run", "outcome": None}),
        ("contact", {"station_mm": 67.0, "contact_mm": -0.3}),
        ("contact", {"station_mm": 67.0, "contact_mm": 5.0}),
        ("fault", {"cause": "camera_lost"}),
        ("session", {"job": "run", "outcome": "fault"}),
        ("telemetry", {"arm": {}}),
    ):
        counts.heard(topic, data)
    counts.timed("Grab", 0.15)
    counts.requests.add(0.0002)
    counts.late.add(0.0)
    return counts


def samples(counts: Counts, at: Now) -> dict[str, float]:
    """Return the page's figures by name with labels."""
    from prometheus_client import generate_latest

    page = generate_latest(registry_of(Collector(counts, lambda: at))).decode()
    lines = [line for line in page.splitlines() if not line.startswith("#")]
    return {name: float(value) for name, _, value in (line.rpartition(" ") for line in lines)}


def test_every_figure_stands_on_the_page() -> None:
    """States, sessions, faults, latencies, contacts, room, lateness, junk, uptime, versions."""
    found = samples(counted(), now())
    for name, value in {
        'legato_state{state="idle"}': 1.0,
        'legato_state{state="fault"}': 0.0,
        'legato_sessions_total{job="run",outcome="fault"}': 1.0,
        'legato_faults_total{cause="camera_lost"}': 1.0,
        'legato_states_entered_total{state="fault"}': 1.0,
        "legato_junk_messages_total": 3.0,
        "legato_uptime_seconds": 12.5,
        "legato_records_free_bytes": 1.5e9,
        "legato_loop_late_seconds": 0.001,
        "legato_worker_alive": 1.0,
        "legato_arm_referenced": 0.0,
        'legato_contact_height_mm_bucket{le="-0.25",station="67"}': 1.0,
        'legato_contact_height_mm_bucket{le="2",station="67"}': 1.0,
        'legato_contact_height_mm_bucket{le="+Inf",station="67"}': 2.0,
        'legato_effect_seconds_bucket{effect="Grab",le="0.1"}': 0.0,
        'legato_effect_seconds_bucket{effect="Grab",le="0.2"}': 1.0,
        'legato_effect_seconds_sum{effect="Grab"}': 0.15,
        "legato_request_seconds_count": 1.0,
        'legato_stop_seconds_bucket{le="0.0005",until="commanded"}': 1.0,
        'legato_stop_seconds_sum{until="commanded"}': 0.0003,
    }.items():
        assert found[name] == pytest.approx(value), name
    assert "legato_calibration_sigma_mm" not in found
    assert any(name.startswith("legato_build_info{") for name in found)
    assert "process_resident_memory_bytes" in found


def test_what_has_not_happened_yet_stands_there_as_0() -> None:
    """Prometheus takes a series' first value for what was always there, and counts from it."""
    found = samples(Counts((7.0, 187.0)), now())
    assert all(found[f'legato_faults_total{{cause="{cause}"}}'] == 0.0 for cause in Cause)
    assert found['legato_sessions_total{job="massage",outcome="interrupted"}'] == 0.0
    assert all(found[f'legato_states_entered_total{{state="{state}"}}'] == 0.0 for state in STATES)
    assert found['legato_contact_height_mm_bucket{le="+Inf",station="187"}'] == 0.0


def test_a_latched_fault_is_shown_with_its_cause() -> None:
    """As long as it is latched."""
    found = samples(Counts(), now(state="fault", fault="estop"))
    assert found['legato_fault{cause="estop"}'] == 1.0
    assert not [name for name in samples(Counts(), now()) if name.startswith("legato_fault{")]


def test_the_page_is_served_on_loopback_by_its_own_thread() -> None:
    """A scrape reads what holds at that moment; after the end nothing listens."""
    at = [now()]
    server = MetricsServer("127.0.0.1", 0, Collector(counted(), lambda: at[0]))
    try:
        for state in ("idle", "massage_7"):
            at[0] = now(state=state)
            with urllib.request.urlopen(server.url, timeout=10.0) as page:
                assert f'legato_state{{state="{state}"}} 1.0' in page.read().decode()
    finally:
        server.close()
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(server.url, timeout=10.0)


def test_a_port_that_is_taken_is_an_error_of_the_system() -> None:
    """Whoever starts it decides what follows."""
    first = MetricsServer("127.0.0.1", 0, Collector(Counts(), now))
    try:
        port = int(first.url.split(":")[2].split("/")[0])
        with pytest.raises(OSError, match="in use"):
            MetricsServer("127.0.0.1", port, Collector(Counts(), now))
    finally:
        first.close()


def test_the_library_is_not_loaded_unless_metrics_are_on() -> None:
    """The daemon's own modules do without it."""
    look = "import sys, legato.daemon.serve; print('prometheus_client' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_the_dashboard_asks_only_for_metrics_that_are_there() -> None:
    """Every query of the shipped dashboard, label by label where it selects one."""
    found = samples(counted(), now(fault="estop", sigma_mm=0.1))
    names = {name.partition("{")[0] for name in found}
    dashboard = json.loads(shipped("grafana-legato.json").read_text(encoding="utf-8"))
    queries = [t["expr"] for panel in dashboard["panels"] for t in panel["targets"]]
    assert len(queries) > 25
    asked = {name for query in queries for name in METRIC.findall(query)}
    assert asked <= names, asked - names
    wanted = {name for name in names if not re.search(r"_(count|sum|created|bucket)$", name)}
    own = {name for name in wanted if name.startswith("legato_")}
    assert not own - asked, "each figure has its place on the dashboard"


def test_the_dashboards_panels_lie_beside_each_other() -> None:
    """No panel covers another, and each has a number of its own."""
    panels = json.loads(shipped("grafana-legato.json").read_text(encoding="utf-8"))["panels"]
    assert len({panel["id"] for panel in panels}) == len(panels)
    places = [panel["gridPos"] for panel in panels]
    cells = [
        (x, y)
        for p in places
        for x in range(p["x"], p["x"] + p["w"])
        for y in range(p["y"], p["y"] + p["h"])
    ]
    assert len(cells) == len(set(cells))
    assert max(x for x, _ in cells) < 24
