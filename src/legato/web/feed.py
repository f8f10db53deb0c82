"""Follows the daemon in a thread of its own and posts what it says; nobody else listens for it.

One subscription and one status a second, whatever the number of pages. A daemon that has gone is
looked for again until it is back; whatever it said meanwhile is asked for by its numbers.
"""

import threading
from collections.abc import Callable, Mapping
from typing import Any

from legato.daemon.client import Client, DaemonUnavailable, KeyRefused, RpcError
from legato.daemon.keys import Keys

SILENT_S = 2.5  # heartbeats come every second: so long a silence is a daemon that has gone
AGAIN_S = 0.3
REFUSED_S = 2.0
ANSWER_S = 2.0
STOP_S = 0.5
TURNS = ("state", "session", "fault", "heartbeat")  # what makes status worth asking for
PAST = 30

Post = Callable[[str, Any], None]


class Feed:
    """One follower; `post(kind, what)` is called in its thread.

    Kinds are `described`, `status`, `sessions` (answers), `event` (topic and event), `up`, and
    `lost` (reason, hint, and whether the stop line answers, None while that is not known).
    """

    def __init__(
        self,
        lines: Mapping[str, str],
        keys: Keys | None,
        post: Post,
        *,
        answer_s: float = ANSWER_S,
        stop_s: float = STOP_S,
    ) -> None:
        self._waits = answer_s, stop_s
        self._lines = lines["requests"], lines["events"]
        self._stop_line = lines["stop"]
        self._stops: bool | None = None
        self._keys = keys
        self._post = post
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="feed", daemon=True)

    def start(self) -> None:
        """Begin to follow."""
        self._thread.start()

    def end(self) -> None:
        """Stop following, soon."""
        self._ended.set()

    def _run(self) -> None:
        while not self._ended.is_set():
            try:
                with Client(*self._lines, timeout_s=self._waits[0], keys=self._keys) as client:
                    self._stay(client)
            except RpcError as error:
                # A refused key: the daemon may be another one tomorrow.
                reason, hint = error.data.get("reason") or error.message, error.data.get("hint")
                self._lose(str(reason), str(hint or ""))
                self._ended.wait(REFUSED_S)
            except Exception as error:  # noqa: BLE001  # pages must learn that nobody listens
                text = f"a bug in the page's server: {type(error).__name__}: {error}"
                self._lose(text, "report it; it is tried again")
                self._ended.wait(REFUSED_S)

    def _stay(self, client: Client) -> None:
        """Follow, through every silence: who stays subscribed knows what it has missed."""
        while not self._ended.is_set():
            try:
                self._follow(client)
            except DaemonUnavailable as error:
                self._lose(str(error), "see that `legato serve` runs")
                self._ended.wait(AGAIN_S)

    def _lose(self, reason: str, hint: str) -> None:
        """Post that nothing is heard; and whether a stop would be, which takes longer to know."""
        self._post("lost", (reason, hint, self._stops))
        try:
            with Client(self._stop_line, timeout_s=self._waits[1], keys=self._keys) as client:
                client.call("ping")
            self._stops = True
        except KeyRefused:
            self._stops = False  # no stop of ours is let in
        except RpcError:
            self._stops = True  # an answer all the same
        except DaemonUnavailable:
            self._stops = False
        self._post("lost", (reason, hint, self._stops))

    def _follow(self, client: Client) -> None:
        """Post all that a daemon says until it is silent. Raises DaemonUnavailable, RpcError."""
        boot = self._look_whole(client)
        for topic, event in client.events(SILENT_S):
            if event["boot"] != boot:
                boot = self._look_whole(client)
            self._post("event", (topic, event))
            if topic in TURNS:
                self._post("status", client.call("status"))
            if topic == "session":
                self._post("sessions", client.call("sessions", limit=PAST)["sessions"])
            if self._ended.is_set():
                return
        raise DaemonUnavailable(f"the daemon at {self._lines[0]} has fallen silent")

    def _look_whole(self, client: Client) -> str:
        """Ask for everything that no event tells; return the daemon's boot."""
        self._post("described", client.call("describe"))
        status = client.call("status")
        self._stops = None
        self._post("status", status)
        self._post("up", None)  # what a page believes from now on is of now
        self._post("sessions", client.call("sessions", limit=PAST)["sessions"])
        return str(status["boot"])
