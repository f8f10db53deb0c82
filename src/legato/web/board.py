"""What is known of the cell, as the sections of the page: events and answers in, sections out.

Pure: no socket, file, clock or thread. `publish` is given each section that may have changed.
"""

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from legato.control.states import CALIBRATE, CAPTURE, VERIFY, massage_state
from legato.geometry.arm import ArmModel
from legato.report.happened import listed
from legato.web.pose import posed
from legato.web.present import Contacts, Held, leg_told, picture_told
from legato.web.when import When

Publish = Callable[[str, Any], None]
Row = Mapping[str, Any]

LINES = 40  # events kept for the page's list
LISTED = ("state", "progress", "contact", "fault", "session")
HEAD = ("topic", "boot", "seq")
TELLING = ("id", "job", "by", "outcome", "reason")
TOUCHING = ("run", "massage")  # jobs that make contacts
LOOKING = (CAPTURE, VERIFY)  # states whose progress has no station


class Board:
    """The page's sections, made from what the daemon says; times `wall` are ISO text.

    `time_scale` is how many of the cell's seconds pass in one of the wall's.
    """

    def __init__(self, model: ArmModel, publish: Publish, time_scale: float = 1.0) -> None:
        self._model = model
        self._publish = publish
        self._when = When(time_scale)
        self._lines: deque[dict[str, Any]] = deque(maxlen=LINES)
        self._contacts = Contacts()
        self._held = Held()
        self._picture: Row | None = None
        self._solved: Row | None = None
        self._progress: Row | None = None
        self._fault: dict[str, Any] | None = None
        self._state: str | None = None
        self._boot: str | None = None
        self._running: str | None = None
        self._moving: str | None = None  # the session whose telemetry was heard
        self.lost("not asked yet", "", None)

    def lost(self, reason: str, hint: str, wall: str | None, stop: bool | None = None) -> None:
        """Take in that the daemon is not to be had; what is shown from now on is old.

        `wall` is when it was heard last, None where it never was.
        `stop` says whether its stop line answers all the same, None where that is not known.
        """
        told = {"up": False, "since": wall, "reason": reason, "hint": hint, "stop": stop}
        self._publish("line", told)

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
        calibration = told["calibration"]
        when = {
            "picture": self._when.told("picture", told["camera"]["age_s"], wall),
            "calibration": self._when.told("calibration", (calibration or {}).get("age_s"), wall),
        }
        rest = {k: v for k, v in told.items() if k not in ("arm", "progress")}
        self._publish("status", rest | {"when": when})
        self._running = told["session"]
        if self._running is None or self._moving != self._running:
            self._publish("arm", posed(self._model, told["arm"]) | {"why": None})
        self._enter(told["state"], {})
        self._latch(told["fault"])
        self._hold(calibration)
        self._go_on(told["progress"])

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
                self._go_on(data)
            case "contact":
                self._touch(data)
            case "fault" if self._state == "fault":
                self._latch(data)
            case "session":
                self._session_told(data)

    def looked(self, picture: Row | None, solved: Row | None, touched: Contacts | None) -> None:
        """Take in what the records have; `touched` before this process listened, perhaps.

        To contacts of a session that has begun meanwhile there is nothing to add.
        """
        self._picture, self._solved = picture, solved
        if touched is not None and self._contacts.session in (None, touched.session):
            self._contacts.recall(touched)
        self._tell_held()

    def _anew(self, boot: str, wall: str) -> None:
        """Begin with a daemon that has started anew: nothing it has not said is known."""
        self._boot = boot
        self._fault = self._state = self._moving = None
        self._publish("session", None)
        self._publish("line", {"up": True, "since": wall, "boot": boot})
        self._hold(None)

    def up(self, wall: str) -> None:
        """Take in that the daemon answers again."""
        self._publish("line", {"up": True, "since": wall, "boot": self._boot})

    def _enter(self, state: str, data: Row) -> None:
        if state == self._state and not data:
            return
        self._state = state
        if state == CALIBRATE:
            self._hold(None)
        self._go_on(self._progress)
        told = {"previous": data.get("previous"), "cause": data.get("cause"), "by": data.get("by")}
        self._publish("state", {"state": state, **told})
        if state != "fault":
            self._latch(None)

    def _latch(self, fault: Row | None) -> None:
        """Keep a fault, its evidence in words; status does not tell what its event told of that."""
        if fault is None:
            self._fault = None
        elif (
            self._fault is None
            or fault.get("since") != self._fault.get("since")
            or fault.get("evidence")
        ):
            self._fault = {**fault, "evidence": _in_words(fault)}
        self._publish("fault", self._fault)

    def _list(self, topic: str, event: Row, wall: str) -> None:
        """Add an event to the page's list; a new subscription tells the last ones again."""
        mark = (event["boot"], event["seq"])
        if all((line["boot"], line["seq"]) != mark for line in self._lines):
            self._lines.append({**event, "topic": topic, "wall": wall})
            self._publish("lines", list(self._lines))

    def _hold(self, calibration: Row | None) -> None:
        """Take in which calibration counts; while the leg is looked for anew none does."""
        held = Held(self._boot, None if self._state == CALIBRATE else calibration)
        changed = (held.boot, held.session) != (self._held.boot, self._held.session)
        self._held = held
        if changed:
            self._tell_held()

    def _go_on(self, progress: Row | None) -> None:
        """Take in how far the job is; what it does is told only in the state that it is done in."""
        self._progress = progress
        if progress is not None and not _fits(progress, self._state):
            progress = {**progress, "text": None}
        self._publish("progress", progress)

    def _touch(self, data: Row) -> None:
        session = str(data.get("session"))
        if self._contacts.session != session:
            self._contacts = Contacts(session)
        # A new subscription tells the last contact again, whatever counts by now.
        now = self._held if session == self._running else None
        if self._contacts.touch(data, now):
            self._publish("contacts", self._contacts.told(self._held))

    def _session_told(self, data: Row) -> None:
        if data["outcome"] is None:
            self._running = data["id"]
            self._go_on(None)
            if data["job"] in TOUCHING and self._contacts.session != data["id"]:
                self._contacts = Contacts(str(data["id"]))
                self._publish("contacts", self._contacts.told(self._held))
        self._publish("session", {n: data.get(n) for n in TELLING})

    def _tell_held(self) -> None:
        self._publish("picture", picture_told(self._picture, self._held))
        self._publish("leg", leg_told(self._solved, self._held))
        self._publish("contacts", self._contacts.told(self._held))


def _fits(progress: Row, state: str | None) -> bool:
    """Say whether what a progress tells is done in this state."""
    station = progress.get("station_mm")
    return state in LOOKING if station is None else state == massage_state(station)


def _in_words(fault: Row) -> list[tuple[str, list[str]]]:
    """Return what there is of a fault's evidence: each name with its lines."""
    evidence = {k: v for k, v in (fault.get("evidence") or {}).items() if v not in (None, "", [])}
    return listed(evidence)
