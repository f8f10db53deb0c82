"""The campaign under way: kept on the disk, announced, and asked what it wants next.

One at a time. Between its repetitions the cell is idle and still the campaign's: what moves or
changes the cell is refused to others until it has ended.
"""

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Final

from legato.control.states import FAULT, IDLE
from legato.daemon.campaign import RESET, START, Campaign, Rule, told_of
from legato.daemon.campaign_files import LOOKED_AT, CampaignFiles
from legato.daemon.journal import Journal
from legato.daemon.log import Log
from legato.daemon.sessions import Session, Sessions
from legato.daemon.standing import Setting, Standing
from legato.daemon.tasks import Tasks
from legato.records.errors import RecordError
from legato.records.store import Store
from legato.wire import requests
from legato.wire.jsonrpc import Failure

RESET_LASTS_S: Final = 60.0  # wall s after which a reset is given up
AGAIN_S: Final = 1.0  # wall s before the disk is asked again
SHOWN: Final = 200  # sessions in an answer: a message has an end
FROZEN_S: Final = 30.0  # without a look, asleep or stopped: who comes back may find a person there
NEAR_S: Final = (0.02, 1.0)
ASKED: Final = ("job", "count", "every_s", "for_s", "until", "resets")  # what a key stands for


@dataclass
class Campaigns:
    """What the conductor knows of campaigns; `clock` is the cell's s, `give_up` forgets a task.

    `awake` is s that also count while the machine sleeps.
    """

    files: CampaignFiles
    journal: Journal
    sessions: Sessions
    log: Log
    clock: Callable[[], float]
    give_up: Callable[[int], None]
    meta: Mapping[str, Any] = field(default_factory=dict)
    awake: Callable[[], float] = lambda: time.clock_gettime(time.CLOCK_BOOTTIME)
    current: Campaign | None = None
    _last: dict[str, Any] | None = None
    _reset: tuple[int, float] | None = None  # its task's number, and since when
    _again: float | None = None
    _looked: bool = False
    _looked_at: float = 0.0

    @property
    def underway(self) -> Campaign | None:
        """The campaign that is not over, if there is one."""
        return self.current if self.current is not None and self.current.underway else None

    def told(self) -> Mapping[str, Any] | None:
        """Return what status tells: of the campaign under way, or of the last one."""
        if self.current is not None:
            return self.current.told(self.clock())
        if not self._looked:
            self._looked = True
            self._last = self._latest()
        return self._last

    def listed(self, request: requests.Campaigns) -> dict[str, Any]:
        """Return one summary, its latest sessions only, or a list of the latest campaigns."""
        if request.campaign is None:
            return {"campaigns": self._heads(request.limit)}
        current = self.current
        if current is not None and current.id == request.campaign:
            rows = current.sessions
            left_out = max(len(rows) - SHOWN, 0)
            return current.document() | {"sessions": rows[-SHOWN:], "left_out": left_out}
        found = self.files.shown(request.campaign, SHOWN)
        if found is None:
            raise Failure("invalid_params", f"there is no campaign {request.campaign!r}")
        return found

    def with_key(self, asked: requests.Campaign) -> str | None:
        """Return the id of the campaign that a request's key has started.

        Raises Failure where another campaign was asked for with it.
        """
        current = self.current
        if current is not None and current.key == asked.key:
            found = current.document()
        else:
            found = next((h for h in self._heads(None) if h["key"] == asked.key), {})
        for name in ASKED if found else ():
            if found.get(name) != getattr(asked, name):
                was = f"{name} {found.get(name)}, not {getattr(asked, name)}"
                reason = f"this key has started campaign {found['id']} with {was}"
                raise Failure("invalid_params", reason, "use a new key for each campaign")
        return found.get("id")

    def need_none(self, what: str) -> None:
        """Raise Failure while a campaign is under way."""
        if (campaign := self.underway) is not None:
            reason = f"{what} must wait: campaign {campaign.id} of {campaign.by} is under way"
            raise Failure("busy", reason, "send stop, or end_campaign to let its repetition end")

    def prepare(
        self, asked: requests.Campaign, *, by: str, since: int, now: float, manned: bool
    ) -> Campaign:
        """Return a new campaign, kept on the disk before anything of it begins. Raises Failure."""
        self.need_none("campaign")
        rule, started = rule_of(asked, self.sessions.now(), now), self.sessions.now()
        name = self.files.fresh_id(started)
        made = Campaign(
            name, rule, by, asked.key, started, self.clock(), since, manned, dict(self.meta)
        )
        try:
            self.files.write(name, made.document())
            self.files.prune()
        except RecordError as error:
            raise Failure("precondition", error.text, error.hint) from error
        return made

    def withdraw(self, campaign: Campaign) -> None:
        """Forget a campaign whose first repetition was refused."""
        try:
            self.files.remove(campaign.id)
        except RecordError as error:
            self.log.error("campaign_not_kept", text=error.text, hint=error.hint)

    def begin(self, campaign: Campaign, session: str) -> None:
        """Take in that a repetition has begun."""
        first = self.current is not campaign
        self.current, self._looked_at = campaign, self.awake()
        campaign.begin(session, self.clock())
        self._changed("begun" if first else "repetition")

    def touch(self, data: Mapping[str, Any]) -> None:
        """Take in a contact of the running session."""
        if self.underway is not None:
            self.underway.touch(float(data["station_mm"]), float(data["contact_mm"]))

    def end_session(self, session: Session, now: float) -> None:
        """Take in how a session has ended; `now` is the wall's monotonic s."""
        campaign = self.underway
        if campaign is not None and campaign.session == session.id:
            names = ("id", "started", "ended", "outcome", "reason", "cause")
            row = {name: getattr(session, name) for name in names}
            campaign.end_session(row, self.clock(), now)
            self._changed("session")

    def end(self, outcome: str, reason: str) -> None:
        """Let no other repetition begin, if a campaign is under way."""
        campaign = self.underway
        if campaign is not None and campaign.outcome is None:
            campaign.end(outcome, reason)
            self._changed("ending")

    def asked_to_end(self, by: str) -> dict[str, Any]:
        """Let the repetition under way end, and begin no other. Raises Failure."""
        if self.underway is None:
            raise Failure("precondition", "no campaign is under way", "see campaign in status")
        self.end("stopped", f"ended by {by}")
        assert self.current is not None
        return self.current.told(self.clock())

    def begin_reset(self, token: int, now: float) -> None:
        """Take in the task that tries to leave the fault."""
        assert self.underway is not None, "only a campaign under way is reset"
        self._reset = token, now
        self.underway.begin_reset(self.sessions.now())
        self._changed("reset")

    def end_task(self, token: int, problem: str | None, now: float) -> None:
        """Take in the end of a task, which may be the reset."""
        if self._reset is None or self._reset[0] != token:
            return
        self._reset = None
        if self.underway is not None:
            self.underway.end_reset(problem, self.clock(), now)
            self._changed("reset")

    def wish(self, state: str, fault: Mapping[str, Any] | None, now: float) -> str | None:
        """Return START or RESET where the campaign under way wants it now."""
        if self._again is not None and now >= self._again:
            self._keep(now)
        campaign = self.underway
        if campaign is None:
            return None
        self._see_reset(now)
        self._see_freeze()
        wish = campaign.wish(self.clock(), now)
        if state == FAULT and fault is not None and wish == START:
            self.end("fault", f"{fault['cause']}: {fault['text']}")
        if campaign.underway and campaign.outcome is not None and campaign.session is None:
            self._changed("ended")
        fits = {START: IDLE, RESET: FAULT}
        return wish if wish is not None and state == fits[wish] else None

    def next_due(self, now: float) -> float:
        """Return when to ask again, in the wall's s: the cell's may run faster, nobody says how."""
        campaign = self.underway
        left = campaign.next_s(self.clock()) if campaign is not None else None
        return now + min(max(left / 20.0, NEAR_S[0]), NEAR_S[1]) if left is not None else now + 60.0

    def _see_freeze(self) -> None:
        """End a campaign whose daemon was frozen or asleep: nothing moves by itself after that."""
        before, self._looked_at = self._looked_at, self.awake()
        lasted = self._looked_at - before
        if lasted > FROZEN_S:
            self.end("interrupted", f"the daemon was frozen for {lasted:.0f} s")

    def _see_reset(self, now: float) -> None:
        """Give up a reset that does not end: the fault stays."""
        if self._reset is not None and now - self._reset[1] > RESET_LASTS_S:
            self.give_up(self._reset[0])
            self._reset = None
            self.end("fault", f"a reset has not ended within {RESET_LASTS_S:g} s")

    def _changed(self, what: str) -> None:
        """Keep and announce what has become of the campaign."""
        campaign = self.current
        assert campaign is not None, "only a campaign changes"
        if campaign.outcome is not None and campaign.session is None and campaign.underway:
            campaign.ended, what = self.sessions.now(), "ended"
        told = campaign.told(self.clock())
        self._keep(None)
        self.log.info("campaign", what=what, **told)
        self.journal.publish("campaign", {"what": what} | told)

    def _keep(self, now: float | None) -> None:
        campaign = self.current
        assert campaign is not None, "only a campaign is kept"
        try:
            self.files.write(campaign.id, campaign.document())
            self._again = None
        except RecordError as error:
            if self._again is None:
                self.log.error("campaign_not_kept", text=error.text, hint=error.hint)
            self._again = (now or 0.0) + AGAIN_S

    def _latest(self) -> dict[str, Any] | None:
        """Return what status tells of the last campaign of an earlier daemon."""
        with suppress(RecordError):
            latest = map(self.files.read, self.files.ids()[:LOOKED_AT])
            return next((told_of(found) for found in latest if found is not None), None)
        return None

    def _heads(self, limit: int | None) -> list[dict[str, Any]]:
        try:
            return self.files.heads(limit)
        except RecordError as error:
            self.log.error("campaigns_not_read", text=error.text, hint=error.hint)
            return []


def campaigns_of(
    setting: Setting,
    standing: Standing,
    journal: Journal,
    store: Store,
    log: Log,
    tasks: Tasks,
) -> Campaigns:
    """Return the campaigns of a cell, none of which is under way."""
    meta = {"boot": setting.boot, "simulated": setting.settings.simulated}
    files = CampaignFiles(store.state_dir)
    return Campaigns(files, journal, standing.sessions, log, setting.clock, tasks.give_up, meta)


def rule_of(asked: requests.Campaign, today: str, now: float) -> Rule:
    """Return the rule of a request; `today` is the time of day, `now` the wall's s.

    Raises Failure where nothing would ever end it, or its end is past.
    """
    if asked.count is None and asked.for_s is None and asked.until is None:
        raise Failure("invalid_params", "a campaign has an end", "give count, for_s or until")
    ends_at = float("inf")
    if asked.until is not None:
        ends_at = now + _seconds(today, asked.until)
    return Rule(
        asked.job, asked.count, asked.every_s, asked.for_s, asked.until, asked.resets, ends_at
    )


def _seconds(today: str, until: str) -> float:
    """Return how long it is until a time of day; from then on the wall's clock is not asked."""
    hint = "an ISO time with its zone, to come: 2026-03-02T06:00:00+01:00"
    try:
        left = (datetime.fromisoformat(until) - datetime.fromisoformat(today)).total_seconds()
    except (ValueError, TypeError, OverflowError) as error:
        raise Failure("invalid_params", f"until: {error}", hint) from error
    if left <= 0:
        raise Failure("invalid_params", f"{until} is past", hint)
    return left
