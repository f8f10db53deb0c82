"""Prometheus: what the daemon has counted, on loopback, served by a thread of its own.

prometheus_client is loaded only where metrics are on. A scrape reads counts and what the loop
holds already; no device, lock or socket of the daemon is touched.
"""

import platform
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

from legato import __version__
from legato.control.table import JOBS
from legato.daemon.counts import Counts, Histogram
from legato.hal.faults import Cause
from legato.wire.requests import OUTCOMES

if TYPE_CHECKING:
    from prometheus_client.core import Metric
    from prometheus_client.registry import CollectorRegistry

Stops = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class Now:
    """What holds at the moment of a scrape; None where nobody knows."""

    states: Sequence[str]
    state: str
    fault: str | None
    uptime_s: float
    late_s: float
    junk: int
    free_mb: float | None
    worker_alive: bool
    arm_connected: bool
    arm_referenced: bool
    camera_connected: bool
    rms_px: float | None
    sigma_mm: float | None
    stops: Stops


class Collector:
    """Makes a scrape's metrics from the counts and from `now`, which the scraping thread calls."""

    def __init__(self, counts: Counts, now: Callable[[], Now]) -> None:
        self._counts = counts
        self._now = now

    def collect(self) -> "Iterator[Metric]":
        """Yield every metric; each is there from the first scrape on."""
        now = self._now()
        yield from _gauges(now)
        yield from _counters(self._counts, now)
        yield from _histograms(self._counts, now)


def registry_of(collector: Collector) -> "CollectorRegistry":
    """Return a registry of its own with the daemon's metrics and those of its process."""
    from prometheus_client import ProcessCollector
    from prometheus_client.registry import CollectorRegistry

    registry = CollectorRegistry()
    registry.register(collector)
    ProcessCollector(registry=registry)
    return registry


class MetricsServer:
    """Answers scrapes at an address on loopback until it is closed. Raises OSError."""

    def __init__(self, host: str, port: int, collector: Collector) -> None:
        from prometheus_client import start_http_server

        self._server, self._thread = start_http_server(port, host, registry_of(collector))
        where = f"[{host}]" if ":" in host else host
        self.url = f"http://{where}:{self._server.server_port}/metrics"

    def close(self) -> None:
        """End the thread and let go of the port."""
        threading.Thread(target=self._server.shutdown, daemon=True).start()
        self._thread.join(2.0)
        self._server.server_close()


def _gauges(now: Now) -> "Iterator[Metric]":
    from prometheus_client.core import GaugeMetricFamily as Gauge

    state = Gauge("legato_state", "1 for the state that the cell is in", labels=["state"])
    for name in now.states:
        state.add_metric([name], float(name == now.state))
    yield state
    fault = Gauge("legato_fault", "1 for the cause of a latched fault", labels=["cause"])
    if now.fault is not None:
        fault.add_metric([now.fault], 1.0)
    yield fault
    build = Gauge("legato_build_info", "Versions", labels=["version", "python"])
    build.add_metric([__version__, platform.python_version()], 1.0)
    yield build
    figures: tuple[tuple[str, str, float | None], ...] = (
        ("uptime_seconds", "Since the daemon's start", now.uptime_s),
        ("loop_late_seconds", "How late the loop's last heartbeat was", now.late_s),
        ("records_free_bytes", "Room left for records", _bytes(now.free_mb)),
        ("worker_alive", "0 where the worker is stuck in something", now.worker_alive),
        ("arm_connected", "1 where the arm answers", now.arm_connected),
        ("arm_referenced", "1 where it is known where the arm stands", now.arm_referenced),
        ("camera_connected", "1 where the camera answers", now.camera_connected),
        ("calibration_rms_pixels", "Residuals of the calibration in use", now.rms_px),
        ("calibration_sigma_mm", "Standard deviation of the worst station", now.sigma_mm),
    )
    for name, text, value in figures:
        gauge = Gauge(f"legato_{name}", text)
        if value is not None:
            gauge.add_metric([], float(value))
        yield gauge


def _counters(counts: Counts, now: Now) -> "Iterator[Metric]":
    from prometheus_client.core import CounterMetricFamily as Counter

    # Each count stands there from the start as 0: Prometheus does not see the first of a series
    # that begins with 1, and a night's only fault would be none.
    sessions = Counter("legato_sessions", "Sessions that have ended", labels=["job", "outcome"])
    for labels in product(JOBS, OUTCOMES):
        sessions.add_metric(labels, counts.sessions.get(labels, 0))
    yield sessions
    for name, text, label, found, values in (
        ("faults", "Faults that were latched", "cause", counts.faults, tuple(map(str, Cause))),
        ("states_entered", "States that were entered", "state", counts.entered, now.states),
    ):
        counter = Counter(f"legato_{name}", text, labels=[label])
        for value in values:
            counter.add_metric([value], found.get(value, 0))
        yield counter
    junk = Counter("legato_junk_messages", "Messages that were none")
    junk.add_metric([], now.junk)
    yield junk


def _histograms(counts: Counts, now: Now) -> "Iterator[Metric]":
    plain = {"": counts.requests}
    yield _histogram("request_seconds", "How long a message keeps the loop", None, plain)
    yield _histogram("loop_lateness_seconds", "Lateness of heartbeats", None, {"": counts.late})
    text = "How long effects took: Grab a picture, Solve the pose, Move the arm"
    yield _histogram("effect_seconds", text, "effect", dict(counts.effects))
    text = "Touched height over the predicted surface, by station in mm"
    yield _histogram("contact_height_mm", text, "station", dict(counts.heights))
    text = "From a stop's arrival until it was commanded, and until the driver confirmed it"
    yield _histogram("stop_seconds", text, "until", {k: _tally(v) for k, v in now.stops.items()})


def _histogram(name: str, text: str, label: str | None, found: Mapping[str, Histogram]) -> "Metric":
    from prometheus_client.core import HistogramMetricFamily

    metric = HistogramMetricFamily(f"legato_{name}", text, labels=[label] if label else [])
    for value, histogram in found.items():
        counts = list(histogram.counts)
        edges = [*(f"{bound:g}" for bound in histogram.bounds), "+Inf"]
        buckets = [(edge, float(sum(counts[: n + 1]))) for n, edge in enumerate(edges)]
        metric.add_metric([value] if label else [], buckets, histogram.sum)
    return metric


def _tally(told: Mapping[str, Any]) -> Histogram:
    """Return the stop line's own counts, in s."""
    histogram = Histogram([bound / 1000.0 for bound in told["at_most_ms"]])
    histogram.counts = list(told["counts"])
    histogram.sum = float(told.get("sum_ms") or 0.0) / 1000.0
    return histogram


def _bytes(mb: float | None) -> float | None:
    return None if mb is None else mb * 1e6
