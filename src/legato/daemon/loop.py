"""The loop: one poller over requests, subscriptions and the worker's mailbox, in the main thread.

It alone owns the sockets. Every message is handled alone, and nothing that comes in ends it.
"""

import time
from collections import deque
from collections.abc import Callable
from math import ceil

import zmq

from legato.daemon.conductor import Conductor
from legato.daemon.desk import Desk
from legato.daemon.events import Events
from legato.daemon.gate import Gate
from legato.daemon.mailbox import Mailbox
from legato.daemon.sockets import Arrived, Sockets

QUIET_S = 0.5  # nothing is logged so long: loading the log would keep the first client waiting
MOST = 4096  # requests sorted out at once
BATCH = 64  # subscriptions handled before the others have their turn


class Loop:
    """Polls, and hands each message to the one that knows what to do.

    `listening` is called once, when whoever asked at once has been answered; `ready` when the
    devices are known.
    """

    def __init__(
        self,
        sockets: Sockets,
        mailbox: Mailbox,
        conductor: Conductor,
        desk: Desk,
        events: Events,
        ready: Callable[[], None] = lambda: None,
        listening: Callable[[], None] = lambda: None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._sockets = sockets
        self._mailbox = mailbox
        self._conductor = conductor
        self._desk = desk
        self._events = events
        self._ready = ready
        self._listening = listening
        self._was_ready = self._was_listening = False
        self._now = now
        self._stops = 0
        self._seen: tuple[int, ...] = ()  # the desk's version when time was last let pass
        self._due = 0.0  # when it must pass again
        self._before: deque[tuple[Arrived, int]] = deque()
        self._poller = zmq.Poller()
        self._poller.register(sockets.requests, zmq.POLLIN)
        self._poller.register(sockets.events, zmq.POLLIN)
        self._mail = mailbox.fileno()
        self._poller.register(self._mail, zmq.POLLIN)

    def run(self, end: Callable[[], str | None] = lambda: None) -> None:
        """Serve until the conductor has finished; once `end()` names who wants it, it begins to."""
        while not self._conductor.finished:
            self.turn()
            by = end()
            if by is not None:
                self._conductor.shutdown(by)

    def turn(self) -> None:
        """Wait for what comes next, and handle it: one request, and all else that has come."""
        due = 0.0 if self._before else min(self._due, self._desk.next_due())
        heard = dict(self._poller.poll(ceil(max(due - self._now(), 0.0) * 1000.0)))
        self._conductor.wake(self._now())
        if self._mail in heard:
            for message in self._mailbox.drain():
                self._conductor.receive(message)
        # What is asked first is answered first; a stop is looked for whatever has come.
        self._request(waits=self._sockets.requests in heard)
        if self._sockets.events in heard:
            self._subscriptions()
        # Whoever asks is answered before time is let pass: nothing is due for so short a while.
        self._pass_time(mail=self._mail in heard)
        self._tell()

    def _pass_time(self, *, mail: bool) -> None:
        """Let time pass where it is due or something has changed; a look changes nothing."""
        now = self._now()
        early = now < min(self._due, self._desk.next_due())
        if early and not mail and self._desk.version() == self._seen:
            return
        self._conductor.tick(now)
        self._desk.settle(now)
        self._due, self._seen = self._conductor.next_due(), self._desk.version()

    def _tell(self) -> None:
        """Say once that the daemon listens, and once that it is ready."""
        known = self._conductor.devices_known
        if not self._was_listening and (known or self._conductor.standing.uptime_s >= QUIET_S):
            self._was_listening = True
            self._listening()
        if known and not self._was_ready:
            self._was_ready = True
            self._ready()

    def _request(self, *, waits: bool) -> None:
        """Answer the next request: one that came before the last stop, or one that `waits`."""
        gate = self._conductor.gate
        if gate.number > self._stops:
            self._sort_out(gate)
            # What these stops end is what ran before: nothing that is asked for after them.
            self._conductor.wake(self._now())
            waits = False
        if self._before:
            (frames, who), stops = self._before.popleft()
        elif waits:
            (frames, who), stops = self._sockets.take(self._sockets.requests), self._stops
        else:
            return
        self._desk.receive(frames, self._now(), who, since=stops)

    def _sort_out(self, gate: Gate) -> None:
        """Take in, unanswered, all that waits: it came before the last stop, the rest after it."""
        number = gate.number
        while len(self._before) < MOST:
            arrived = self._sockets.receive(self._sockets.requests)
            if arrived is None:
                self._stops = number
                gate.drain(number)
                return
            self._before.append((arrived, self._stops))

    def _subscriptions(self) -> None:
        for _ in range(BATCH):
            wish = self._sockets.wish()
            if wish is None:
                return
            kind, prefix = wish
            if kind == "wanted":
                self._sockets.snapshot(self._events.latest(prefix.decode("latin-1")))
            elif kind == "junk":
                self._desk.junk += 1
