"""One campaign: a job repeated, and what has come of it. It decides when and whether to go on.

Only what somebody has started is repeated. A fault of the camera may be reset by itself, so many
times as was allowed; every other fault, a stop, or a hand on the cell ends it.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from legato.daemon.spread import Spread
from legato.hal.faults import Cause

CAMERA: Final = (Cause.CAMERA_LOST, Cause.CAMERA_STALE)
RESET_S: Final = (
    5.0  # cell s from a fault to the first reset; twice as long before each further one
)
LONGEST_S: Final = 60.0
START, RESET = "start", "reset"


@dataclass(frozen=True)
class Rule:
    """What was asked for. `every_s` (from start to start) and `for_s` are the cell's s.

    `until` is a time of day for people; `ends_at` is the same moment as the wall's monotonic s.
    """

    job: str
    count: int | None = None
    every_s: float = 0.0
    for_s: float | None = None
    until: str | None = None
    resets: int = 0
    ends_at: float = float("inf")


@dataclass
class Campaign:
    """A campaign from its first repetition on. Times are the cell's s but for those that say not.

    `began` is when, `since` how many stops had been asked for at the stop line before; `manned`
    says that its operator held the lease with a deadman. `started` and `ended` are ISO texts.
    """

    id: str
    rule: Rule
    by: str
    key: str | None
    started: str
    began: float
    since: int = 0
    manned: bool = False
    meta: Mapping[str, Any] = field(default_factory=dict)
    session: str | None = None
    outcome: str | None = None
    reason: str | None = None
    ended: str | None = None
    sessions: list[dict[str, Any]] = field(default_factory=list)
    faults: list[dict[str, Any]] = field(default_factory=list)
    resets: list[dict[str, Any]] = field(default_factory=list)
    contacts: dict[str, Spread] = field(default_factory=dict)
    failed: int = 0  # repetitions that have ended otherwise than done
    _due: float = 0.0
    _reset_due: float | None = None
    _begun: int = 0
    _touched: dict[str, Spread] = field(default_factory=dict)

    @property
    def underway(self) -> bool:
        """Whether it goes on, or its last repetition does."""
        return self.ended is None

    @property
    def resets_left(self) -> int:
        """How many times it may still be reset by itself."""
        return self.rule.resets - len(self.resets)

    def begin(self, session: str, now: float) -> None:
        """Take in that a repetition has begun."""
        self.session, self._due = session, now + self.rule.every_s
        self._begun += 1
        self._touched = {}

    def touch(self, station: float, contact_mm: float) -> None:
        """Take in a contact, in mm over the predicted surface."""
        for spreads in (self.contacts, self._touched):
            spreads.setdefault(f"{station:g}", Spread()).add(contact_mm)

    def end_session(self, row: Mapping[str, Any], now: float, wall: float) -> None:
        """Take in how the repetition has ended, and decide what follows.

        `row` is what is told of its session; `wall` the wall's monotonic s.
        """
        self.session = None
        contacts = {name: spread.told() for name, spread in self._touched.items()}
        self.sessions.append(dict(row) | {"contacts": contacts})
        self.failed += row["outcome"] != "done"
        match row["outcome"]:
            case "fault":
                told = {"session": row["id"], "cause": row["cause"], "text": row["reason"]}
                self.faults.append(told)
                self._fault(str(row["cause"]), str(row["reason"]), now, wall)
            case "stopped" | "interrupted" as outcome:
                self.end(outcome, f"session {row['id']}: {row['reason'] or outcome}")
        self._see_end(now, wall)

    def end(self, outcome: str, reason: str | None) -> None:
        """Let no other repetition begin; the first who says so is right."""
        if self.outcome is None:
            self.outcome, self.reason = outcome, reason
            self._reset_due = None

    def wish(self, now: float, wall: float) -> str | None:
        """Return START or RESET where it is time for one."""
        if self.session is None and self._reset_due is None:
            self._see_end(now, wall)
        if self.outcome is not None or self.session is not None:
            return None
        if self._reset_due is not None:
            return RESET if now >= self._reset_due else None
        return START if now >= self._due else None

    def begin_reset(self, at: str) -> None:
        """Take in that a reset is tried; `at` is an ISO time."""
        cause = self.faults[-1]["cause"] if self.faults else None
        self.resets.append({"at": at, "cause": cause, "well": None, "reason": None})
        self._reset_due = float("inf")

    def end_reset(self, problem: str | None, now: float, wall: float) -> None:
        """Take in how a reset has ended: well, or with a problem."""
        self.resets[-1] |= {"well": problem is None, "reason": problem}
        if problem is None:
            self._reset_due = None
        elif self.outcome is None:
            self._plan_reset(f"it could not be reset: {problem}", now, wall)

    def next_s(self, now: float) -> float | None:
        """Return the cell's s until it does something by itself, None where it waits for an end."""
        if self.outcome is not None or self.session is not None:
            return None
        due = self._due if self._reset_due is None else self._reset_due
        return max(due - now, 0.0) if due < float("inf") else None

    def told(self, now: float) -> dict[str, Any]:
        """Return what status and events tell."""
        left = self.next_s(now)
        return {
            "id": self.id,
            "job": self.rule.job,
            "by": self.by,
            "underway": self.underway,
            "session": self.session,
            "done": len(self.sessions) - self.failed,
            "failed": self.failed,
            "total": self.rule.count,
            "next_in_s": round(left, 3) if left is not None else None,
            "resets": len(self.resets),
            "resets_left": self.resets_left,
            "outcome": self.outcome if self.ended is not None else None,
            "reason": self.reason,
            "ended": self.ended,
        }

    def document(self) -> dict[str, Any]:
        """Return the summary: what was asked, each session, contacts, faults and resets."""
        rule = asdict(self.rule)
        del rule["ends_at"]
        return {
            "id": self.id,
            "key": self.key,
            "by": self.by,
            **self.meta,
            **rule,
            "started": self.started,
            "ended": self.ended,
            "outcome": self.outcome if self.ended is not None else None,
            "reason": self.reason,
            "session": self.session,
            "total": self.rule.count,
            "done": len(self.sessions) - self.failed,
            "failed": self.failed,
            "contacts": {name: spread.told() for name, spread in self.contacts.items()},
            "faults": self.faults,
            "resets_done": self.resets,
            "sessions": self.sessions,
        }

    def _fault(self, cause: str, text: str, now: float, wall: float) -> None:
        if cause in CAMERA:
            self._plan_reset(f"{cause}: {text}", now, wall)
        else:
            self.end("fault", f"{cause}: {text}")

    def _plan_reset(self, why: str, now: float, wall: float) -> None:
        """Plan the next reset, or end where none is left."""
        if self.resets_left <= 0:
            used = f"; {self.rule.resets} resets are used up" if self.rule.resets else ""
            self.end("fault", why + used)
        elif self._over(now, wall) is not None:
            # Nobody resets a fault by itself but to go on.
            self.end("fault", why)
        elif self.outcome is None:
            self._reset_due = now + min(RESET_S * 2.0 ** len(self.resets), LONGEST_S)

    def _see_end(self, now: float, wall: float) -> None:
        """End where no further repetition is due."""
        why = self._over(now, wall)
        if self._reset_due is None and why is not None:
            self.end("done", why)

    def _over(self, now: float, wall: float) -> str | None:
        """Return why no further repetition begins: they were enough, or it would be too late."""
        rule = self.rule
        if rule.count is not None and self._begun >= rule.count:
            return f"{rule.count} repetitions"
        if wall >= rule.ends_at:
            return f"until {rule.until}"
        if rule.for_s is not None and max(now, self._due) >= self.began + rule.for_s:
            return f"for {rule.for_s:g} s"
        return None


def told_of(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return what status tells of a campaign that is over, from its summary."""
    names = ("id", "job", "by", "session", "done", "failed", "total", "outcome", "reason", "ended")
    tried, allowed = document.get("resets_done"), document.get("resets")
    used = len(tried) if isinstance(tried, list) else 0
    return {name: document.get(name) for name in names} | {
        "underway": False,
        "next_in_s": None,
        "resets": used,
        "resets_left": allowed - used if isinstance(allowed, int) else 0,
    }
