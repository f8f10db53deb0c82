"""What a live view knows of a cell: fed by status and events, asked by the screen.

Pure: the time comes in. Whatever is older than the last heartbeat should be is called stale.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from legato.cli.events import line_of

STALE_S = 2.5  # a heartbeat comes every second
KEPT = 200
QUIET = ("telemetry", "heartbeat")
Link = Literal["live", "stale", "lost"]


@dataclass
class Live:
    """One cell as it is seen from here; `heard_at` and `since` are in s of the caller's clock."""

    endpoint: str
    states: tuple[str, ...] = ()
    status: dict[str, Any] = field(default_factory=dict)
    state: str | None = None
    since: float = 0.0
    stays: dict[str, float] = field(default_factory=dict)
    session: str | None = None
    ended: dict[str, Any] | None = None
    why: str | None = None
    station: float | None = None
    progress: dict[str, Any] = field(default_factory=dict)
    contacts: dict[float, list[float]] = field(default_factory=dict)
    said: deque[tuple[float, str, str]] = field(default_factory=lambda: deque(maxlen=KEPT))
    boot: str | None = None
    heard_at: float | None = None
    lost_at: float | None = None

    def link(self, now: float) -> Link:
        """Say whether what is shown is the present, too old, or of a daemon that is gone."""
        if self.lost_at is not None or self.heard_at is None:
            return "lost"
        return "stale" if now - self.heard_at > STALE_S else "live"

    def silent_s(self, now: float) -> float:
        """Return for how long nothing was heard."""
        return now - self.heard_at if self.heard_at is not None else 0.0

    def lose(self, now: float) -> None:
        """Take that the daemon does not answer; what was known stays, and is called old."""
        if self.lost_at is None:
            self.lost_at = now
            self.said.append((now, "link", "the daemon does not answer; trying again"))

    def answered(self, status: Mapping[str, Any], now: float) -> None:
        """Take an answer to `status`."""
        again, other = self.lost_at is not None, self.boot not in (None, status.get("boot"))
        if again or other:
            text = "a daemon that began anew answers" if other else "the daemon answers again"
            self.said.append((now, "link", text))
        if other:
            self.forget()
        self.boot, self.status = status.get("boot"), dict(status)
        self.heard_at, self.lost_at = now, None
        self.session = status.get("session") or self.session
        if status.get("session"):
            self.progress = dict(status.get("progress") or self.progress)
        self.enter(str(status.get("state")), now)

    def forget(self) -> None:
        """Let go of what an earlier daemon did."""
        self.state, self.session, self.ended, self.why, self.station = None, None, None, None, None
        self.stays, self.progress, self.contacts = {}, {}, {}

    def take(self, topic: str, event: Mapping[str, Any], now: float) -> None:
        """Take one event."""
        if self.boot is not None and event.get("boot") != self.boot:
            return  # of a daemon whose status is not known yet, or is no more
        self.heard_at, self.lost_at = now, None
        if topic not in QUIET:
            self.said.append((now, topic, line_of(topic, event)))
        match topic:
            case "state":
                self.enter(str(event.get("state")), now)
                if event.get("state") != "fault":
                    self.status["fault"] = None
            case "telemetry":
                self.status["arm"] = event.get("arm") or {}
                self.why, self.station = event.get("why"), event.get("station_mm")
            case "progress":
                self.progress = dict(event)
            case "contact":
                self._contact(event)
            case "fault":
                self.status["fault"] = dict(event)
            case "session":
                self._session(event)
            case "heartbeat":
                self.status["uptime_s"] = event.get("uptime_s")
                self.enter(str(event.get("state")), now)

    def enter(self, state: str, now: float) -> None:
        """Take that the cell is in a state."""
        if state == self.state:
            return
        if self.state is not None:
            self.stays[self.state] = self.stays.get(self.state, 0.0) + now - self.since
        self.state, self.since = state, now

    def _contact(self, event: Mapping[str, Any]) -> None:
        station, height = event.get("station_mm"), event.get("contact_mm")
        of_past = event.get("session") not in (None, self.session)
        if isinstance(station, int | float) and isinstance(height, int | float) and not of_past:
            self.contacts.setdefault(float(station), []).append(float(height))

    def _session(self, event: Mapping[str, Any]) -> None:
        if event.get("outcome") is None:
            begun, state, since, said = event.get("id"), self.state, self.since, self.status
            self.forget()
            self.session, self.state, self.since, self.status = begun, state, since, said
            return
        self.ended = dict(event)
