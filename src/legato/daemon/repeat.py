"""Carries out what a campaign wants, by the very ways in which anybody's request is carried out.

A repetition is refused where the same job would be refused to its operator; that ends the campaign.
"""

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from legato.daemon.campaign import RESET
from legato.daemon.campaigns import Campaigns
from legato.daemon.lease import Leases
from legato.daemon.sessions import Session
from legato.wire.jsonrpc import Failure
from legato.wire.requests import Campaign


class Start(Protocol):
    """Begins a job's session, or raises Failure."""

    def __call__(self, job: str, key: str | None, *, by: str, since: int, **params: Any) -> Session:
        """Begin it, for who has asked `by`, unless a stop came after the first `since`."""


class Repeater:
    """Begins campaigns and their repetitions; `reset` returns the number of its task."""

    def __init__(
        self, campaigns: Campaigns, leases: Leases, start: Start, reset: Callable[[], int]
    ) -> None:
        self._campaigns = campaigns
        self._leases = leases
        self._start = start
        self._reset = reset

    def begin(self, asked: Campaign, *, by: str, since: int, now: float) -> dict[str, Any]:
        """Begin a campaign with its first repetition and return what its operator is told."""
        manned = self._leases.manned(by)
        made = self._campaigns.prepare(asked, by=by, since=since, now=now, manned=manned)
        try:
            session = self._start(made.rule.job, None, by=by, since=since, campaign=made.id)
        except Failure:
            self._campaigns.withdraw(made)
            raise
        self._campaigns.begin(made, session.id)
        return {"campaign": made.id, "session": session.id}

    def go_on(self, state: str, fault: Mapping[str, Any] | None, now: float, *, free: bool) -> None:
        """Do what the campaign under way wants now, where the worker is free for it."""
        wish = self._campaigns.wish(state, fault, now)
        campaign = self._campaigns.underway
        if wish is None or campaign is None or not free:
            return
        by, since = campaign.by, campaign.since
        try:
            if wish == RESET:
                self._campaigns.begin_reset(self._reset(), now)
                return
            self._leases.need_for(by, manned=campaign.manned)
            # Any stop of the stop line since the campaign was asked for keeps the job back.
            job = campaign.rule.job
            session = self._start(job, None, by=by, since=since, campaign=campaign.id)
            self._campaigns.begin(campaign, session.id)
        except Failure as no:
            self._campaigns.end("refused", f"{no.name}: {no.reason}")
