"""What is known of the cell, as the sections of the page: events and answers in, sections out.

Pure: no socket, file, clock or thread. `publish` is given each section that may have changed.
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from legato.geometry.arm import ArmModel
from legato.web.pose import posed

Publish = Callable[[str, Any], None]
Row = Mapping[str, Any]

LINES = 40  # events kept for the page's list
LISTED = ("state", "progress", "contact", "fault", "session")
HEAD = ("topic", "boot", "seq")
TELLING = ("id", "job", "by", "outcome", "reason")
TOUCHING = ("run", "massage")  # jobs that make contacts


class Board:
    """The page's sections, made from what the daemon says; times `wall` are ISO text."""

    def __init__(self, model: ArmModel, publish: Publish) -> None:
        self._model = model
        self._publish = publish
        self._lines: deque[dict[str, Any]] = deque(maxlen=LINES)
        self._contacts: list[dict[str, Any]] = []
        self._contacts_of: str | None = None
        self._fault: dict[str, Any] | None = None
        self._state: str | None = None
        self._boot: str | None = None
        self._running: str | None = None
        self._moving: str | None = None  # the session whose telemetry was heard
        self.lost("not asked yet", "", None)

    def lost(self, reason: str, hint: str, wall: str | None) -> None:
        """Take in that the daemon is not to be had; what is shown from now on is old."""
        self._publish("line", {"up": False, "since": wall, "reason": reason, "hint": hint})

    def described(self, told: Mapping[str, Any]) -> None:
        """Take in the answer to `describe`: the graph of states, and what each answers."""
        answers: dict[str, dict[str, Row]] = {}
        for row in told["table"]:
            rest = {k: v for k, v in row.items() if k not in ("state", "method")}
            answers.setdefault(row["state"], {})[row["method"]] = rest
        methods = {name: method["does"] for name, method in told["methods"].items()}
        graph = {name: told.get(name, []) for name in ("states", "transitions")}
        self._publish("table", {**graph, "answers": answers, "methods": methods})

    def status(self, told: Mapping[str, Any], wall: str) -> None:
        """Take in the answer to `status`."""
        if told["boot"] != self._boot:
            self._anew(str(told["boot"]), wall)
        self._publish("status", {k: v for k, v in told.items() if k not in ("arm", "progress")})
        self._running = told["session"]
        if self._running is None or self._moving != self._running:
            self._publish("arm", posed(self._model, told["arm"]) | {"why": None})
        self._enter(told["state"], {})
        self._latch(told["fault"])
        self._publish("progress", told["progress"])

    def take(self, topic: str, event: Mapping[str, Any], wall: str) -> None:
        """Take in one event."""
        data = {k: v for k, v in event.items() if k not in HEAD}
        if topic in LISTED:
            self._list(topic, event, wall)
        match topic:
            case "telemetry":
                arm, self._moving = posed(self._model, data["arm"]), data["session"]
                self._publish("arm", arm | {n: data.get(n) for n in ("station_mm", "why", "t")})
            case "state":
                self._enter(data["state"], data)
            case "progress" if data["session"] == self._running:
                self._publish("progress", data)
            case "contact":
                self._touch(data)
            case "fault" if self._state == "fault":
                self._latch(data)
            case "session":
                self._session_told(data)

    def recorded(self, session: str, rows: Iterable[Row]) -> None:
        """Take in the contacts of a record: what was touched before this process listened.

        Of a session that has begun meanwhile there is nothing to add.
        """
        if self._contacts_of not in (None, session):
            return
        self._contacts_of = session
        known = {(c["station_mm"], c["stroke"]) for c in self._contacts}
        fresh = [dict(r) for r in rows if (r["station_mm"], r["stroke"]) not in known]
        self._contacts = fresh + self._contacts
        self._tell_contacts()

    def _anew(self, boot: str, wall: str) -> None:
        """Begin with a daemon that has started anew: nothing it has not said is known."""
        self._boot = boot
        self._fault = self._state = self._moving = None
        self._publish("session", None)
        self._publish("line", {"up": True, "since": wall, "boot": boot})

    def up(self, wall: str) -> None:
        """Take in that the daemon answers again."""
        self._publish("line", {"up": True, "since": wall, "boot": self._boot})

    def _enter(self, state: str, data: Row) -> None:
        if state == self._state and not data:
            return
        self._state = state
        told = {"previous": data.get("previous"), "cause": data.get("cause"), "by": data.get("by")}
        self._publish("state", {"state": state, **told})
        if state != "fault":
            self._latch(None)

    def _latch(self, fault: Row | None) -> None:
        """Keep a fault; status does not tell the evidence that its event told."""
        if fault is None:
            self._fault = None
        elif self._fault is None or fault.get("since") != self._fault.get("since"):
            self._fault = {"evidence": {}, **fault}
        elif fault.get("evidence"):
            self._fault = dict(fault)
        self._publish("fault", self._fault)

    def _list(self, topic: str, event: Row, wall: str) -> None:
        """Add an event to the page's list; a new subscription tells the last ones again."""
        mark = (event["boot"], event["seq"])
        if all((line["boot"], line["seq"]) != mark for line in self._lines):
            self._lines.append({**event, "topic": topic, "wall": wall})
            self._publish("lines", list(self._lines))

    def _touch(self, data: Row) -> None:
        session = str(data.get("session"))
        if self._contacts_of != session:
            self._contacts, self._contacts_of = [], session
        known = {(c["station_mm"], c["stroke"]) for c in self._contacts}
        if (data["station_mm"], data["stroke"]) not in known:
            self._contacts.append(dict(data))
            self._tell_contacts()

    def _session_told(self, data: Row) -> None:
        if data["outcome"] is None:
            self._running = data["id"]
            self._publish("progress", None)
            if data["job"] in TOUCHING and self._contacts_of != data["id"]:
                self._contacts, self._contacts_of = [], str(data["id"])
                self._tell_contacts()
        self._publish("session", {n: data.get(n) for n in TELLING})

    def _tell_contacts(self) -> None:
        self._publish("contacts", {"session": self._contacts_of, "rows": self._contacts})
