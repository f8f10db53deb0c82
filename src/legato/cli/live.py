"""What a live view knows of a cell: fed by status and events, asked by the screen.

Pure: the time comes in. Whatever is older than the last heartbeat should be is called stale.
What is shown is in the seconds of whoever looks; the cell's clock may run at another pace, and
heartbeats tell which: they have its time and the daemon's.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from legato.report.lines import line_of

STALE_S = 2.5  # a heartbeat comes every second
KEPT = 200
SURE_S = 0.9  # between two heartbeats that tell how fast the cell's clock runs
QUIET = ("telemetry", "heartbeat")
Link = Literal["live", "stale", "lost"]


@dataclass(frozen=True)
class Said:
    """A line of what happened: when it was heard, its topic, its words, the cell's time of it."""

    heard_at: float
    topic: str
    text: str
    t: float | None = None


@dataclass(frozen=True)
class Beat:
    """A heartbeat: when it was heard, the cell's clock, and how long the daemon has run, all s."""

    heard_at: float
    t: float
    uptime_s: float


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
    said: deque[Said] = field(default_factory=lambda: deque(maxlen=KEPT))
    beats: list[Beat] = field(default_factory=list)  # the first of this boot, and the last
    boot: str | None = None
    heard_at: float | None = None
    lost_at: float | None = None

    def link(self, now: float) -> Link:
        """Say whether what is shown is the present, too old, or of a daemon that is gone."""
        if self.lost_at is not None or self.heard_at is None:
            return "lost"
        return "stale" if now - self.heard_at > STALE_S else "live"

    def upto(self, now: float) -> float:
        """Return until when the cell's state is known: now, or when it was last heard of."""
        return now if self.link(now) == "live" else max(self.heard_at or 0.0, self.since)

    def silent_s(self, now: float) -> float:
        """Return for how long nothing was heard."""
        return now - self.heard_at if self.heard_at is not None else 0.0

    @property
    def pace(self) -> float | None:
        """How many seconds of the cell pass in one of the wall's; None until it is known."""
        if not self.beats or self.beats[-1].uptime_s - self.beats[0].uptime_s < SURE_S:
            return None
        first, last = self.beats[0], self.beats[-1]
        return (last.t - first.t) / (last.uptime_s - first.uptime_s)

    def happened_at(self, said: Said) -> float:
        """Return when something happened; what a new subscriber is sent first may be long past."""
        if said.t is None or not self.pace:
            return said.heard_at
        last = self.beats[-1]
        return min(said.heard_at, last.heard_at - (last.t - said.t) / self.pace)

    def lose(self, now: float) -> None:
        """Take that the daemon does not answer; what was known stays, and is called old."""
        if self.lost_at is None:
            self.lost_at = now
            self.said.append(Said(now, "link", "the daemon does not answer; trying again"))

    def answered(self, status: Mapping[str, Any], now: float) -> None:
        """Take an answer to `status`."""
        again, other = self.lost_at is not None, self.boot not in (None, status.get("boot"))
        if again or other:
            text = "a daemon that began anew answers" if other else "the daemon answers again"
            self.said.append(Said(now, "link", text))
        if other:
            self.forget()
            self.beats = []
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
            self.said.append(Said(now, topic, line_of(topic, event), event.get("t")))
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
                self._beat(event, now)
                self.enter(str(event.get("state")), now)

    def enter(self, state: str, now: float) -> None:
        """Take that the cell is in a state."""
        if state == self.state:
            return
        if self.state == "idle" and self.ended:
            self.progress = {}  # of a job that has ended
        if self.state is not None:
            self.stays[self.state] = self.stays.get(self.state, 0.0) + now - self.since
        self.state, self.since = state, now

    def _beat(self, event: Mapping[str, Any], now: float) -> None:
        t, uptime = event.get("t"), event.get("uptime_s")
        if isinstance(t, int | float) and isinstance(uptime, int | float):
            self.beats = [*self.beats[:1], Beat(now, float(t), float(uptime))]

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
