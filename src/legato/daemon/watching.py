"""Who watches the daemon from outside: systemd and Prometheus, as far as they are there.

Both hear what the loop publishes anyway; neither can hold it up.
"""

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from legato.config.endpoints import listen_address
from legato.control.states import IDLE, states
from legato.daemon.conductor import Conductor
from legato.daemon.counts import CountedDesk, Counts
from legato.daemon.desk import Desk
from legato.daemon.log import Log
from legato.daemon.notify import Notifier, Supervised
from legato.daemon.pulse import Allowed, Pulse
from legato.daemon.standing import HEARTBEAT_S
from legato.daemon.stopline import StopLine
from legato.records.errors import RecordError
from legato.records.store import Store

if TYPE_CHECKING:
    from legato.config.schema import Config
    from legato.daemon.metrics import MetricsServer, Now


class Watching:
    """The line to systemd, the worker's pulse, the counts and, where configured, their page."""

    def __init__(
        self, config: "Config", store: Store, log: Log, environment: Mapping[str, str] = os.environ
    ) -> None:
        self.pulse = Pulse(allowed(config))
        self.counts = Counts(config.leg.stations_mm)
        listen = config.metrics.listen
        self._listen = listen_address(listen) if isinstance(listen, str) else None
        self.desk: type[Desk] = CountedDesk if self._listen else Desk
        self._stations = config.leg.stations_mm
        self._store = store
        self._log = log
        self._notifier = Notifier(environment)
        self._supervised: Supervised | None = None
        self._server: MetricsServer | None = None

    def begin(self, conductor: Conductor, desk: Desk, stopline: StopLine) -> None:
        """Listen from now on; a page that cannot be served is logged, and no more."""
        self._supervised = Supervised(
            self._notifier,
            self.pulse,
            self._log,
            every_s=HEARTBEAT_S,
            status=lambda: status_line(conductor),
        )
        if self._listen is None:
            return
        from legato.daemon.metrics import Collector, MetricsServer

        if isinstance(desk, CountedDesk):
            desk.counts = self.counts
        host, port = self._listen
        collector = Collector(self.counts, lambda: self._now(conductor, desk, stopline))
        try:
            self._server = MetricsServer(host, port, collector)
        except OSError as error:
            self._log.error("metrics_not_bound", listen=f"{host}:{port}", text=str(error))
        else:
            self._log.info("metrics", url=self._server.url)

    def heard(self, topic: str, data: Mapping[str, Any]) -> None:
        """Take note of an event that the loop has published."""
        if self._supervised is None:
            return
        if topic == "heartbeat":
            self._supervised.beat()
            self.counts.late.add(self._supervised.late_s)
        elif topic == "state":
            self._supervised.changed()
        self.counts.heard(topic, data)

    def ready(self) -> None:
        """Tell systemd that both devices are known, or known to be missing."""
        if self._supervised is not None:
            self._supervised.ready()

    def stopping(self) -> None:
        """Tell systemd that the daemon ends."""
        if self._supervised is not None:
            self._supervised.stopping()

    def close(self) -> None:
        """Let go of the page and of the line to systemd."""
        if self._server is not None:
            self._server.close()
        self._notifier.close()

    def _now(self, conductor: Conductor, desk: Desk, stopline: StopLine) -> "Now":
        """Return what holds now; the thread that answers a scrape calls this."""
        from legato.daemon.metrics import Now

        standing, supervised = conductor.standing, self._supervised
        view, fault = standing.view, standing.fault
        calibration = view.memory.calibration if view.memory is not None else None
        solution = calibration.solution if calibration is not None else None
        return Now(
            states=states(self._stations),
            state=standing.state,
            fault=str(fault["cause"]) if fault is not None else None,
            uptime_s=standing.uptime_s,
            late_s=supervised.late_s if supervised is not None else 0.0,
            junk=desk.junk + stopline.junk,
            free_mb=self._free_mb(),
            worker_alive=self.pulse.overdue() is None,
            arm_connected=bool(view.arm["connected"]),
            arm_referenced=bool(view.arm["referenced"]),
            camera_connected=view.camera_connected,
            rms_px=solution.rms_px if solution is not None else None,
            sigma_mm=float(max(solution.sigma_stations)) if solution is not None else None,
            stops=stopline.told(),
        )

    def _free_mb(self) -> float | None:
        try:
            return self._store.free_mb()
        except RecordError:
            return None


def allowed(config: "Config") -> Allowed:
    """Return how long the configured drivers may take."""
    simulated = "sim" in (config.robot.driver, config.camera.driver)
    slowness = max(1.0, 1.0 / config.sim.time_scale) if simulated else 1.0
    return Allowed(config.robot.reply_margin_s, config.camera.timeout_s, slowness)


def status_line(conductor: Conductor) -> str:
    """Return what `systemctl status` shows: state, session or fault, and what is missing."""
    standing = conductor.standing
    said = [standing.state]
    if standing.fault is not None:
        said.append(f"{standing.fault['cause']}: {standing.fault['text']}")
    elif standing.sessions.current is not None and standing.state != IDLE:
        said.append(f"session {standing.sessions.current.id}")
    devices = {"arm": standing.view.arm["connected"], "camera": standing.view.camera_connected}
    missing = " and ".join(name for name, there in devices.items() if not there)
    if missing:
        said.append(f"no {missing}")
    return "; ".join(said)
