"""What a page may ask of the cell: only with the token, only by name, only what the key's role may.

Requests and stops have lines and threads of their own: whatever a request waits for, no stop waits
behind it, nor one stop behind another.
"""

import hmac
import threading
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

from legato.control.table import JOBS, ROLES, STOPS
from legato.daemon.client import Client, DaemonUnavailable, RpcError
from legato.daemon.keys import Keys

ASKED: Final = (*JOBS, "pause", "resume", "reset", "reference", "end_campaign")
METHODS: Final = (*ASKED, *STOPS)
LATE_S: Final = 3.0  # a click that the daemon cannot heed by then has lost its meaning
THREADS: Final = 4
# These are the server's own to say: how it calls, and how long anybody waits.
OURS: Final = frozenset({"self", "method", "seconds", "expires_at", "timeout_s"})


class Refused(Exception):
    """An act that is not carried out: an HTTP status, why, and what to do."""

    def __init__(self, status: int, reason: str, hint: str = "") -> None:
        self.status = status
        self.reason = reason
        self.hint = hint
        super().__init__(reason)


class Line:
    """Threads with a client each, at one endpoint."""

    def __init__(self, endpoint: str, keys: Keys | None, name: str) -> None:
        self._endpoint = endpoint
        self._keys = keys
        self._own = threading.local()
        self._pool = ThreadPoolExecutor(THREADS, thread_name_prefix=name)

    def ask(self, method: str, params: Mapping[str, Any], within_s: float | None = None) -> Any:
        """Return a method's result, in the calling thread. Raises RpcError, DaemonUnavailable."""
        client: Client | None = getattr(self._own, "client", None)
        if client is None:
            client = self._own.client = Client(self._endpoint, keys=self._keys)
        if within_s is None:
            return client.call(method, **params)
        return client.call_within(within_s, method, **params)

    @property
    def pool(self) -> ThreadPoolExecutor:
        """The threads in which to ask."""
        return self._pool


class Acts:
    """The acts of whoever shows the `token`; with none nobody acts."""

    def __init__(self, requests: Line, stops: Line, token: str | None, role: str) -> None:
        self._requests = requests
        self._stops = stops
        self._token = token
        self._allowed = tuple(m for m in METHODS if m in ROLES.get(role, ()))

    def close(self) -> None:
        """Let go of the threads."""
        for line in (self._requests, self._stops):
            line.pool.shutdown(wait=False, cancel_futures=True)

    def check(self, shown: str | None) -> tuple[str, ...]:
        """Return the methods that the bearer of a token may ask for. Raises Refused."""
        if self._token is None:
            raise Refused(403, "this page only looks on", "start `legato web` without --observe")
        if shown is None or not hmac.compare_digest(shown.encode(), self._token.encode()):
            hint = "open the address that `legato web` has printed, with its token"
            raise Refused(401, "this page may not act: it has no token", hint)
        return self._allowed

    def line_of(self, method: str) -> Line:
        """Return the line that a method goes by."""
        return self._stops if method in STOPS else self._requests

    def act(self, method: str, params: Mapping[str, Any]) -> Any:
        """Carry out an act in one of its line's threads and return the daemon's answer.

        Raises Refused.
        """
        if mixed := sorted(OURS & params.keys()):
            raise Refused(400, f"a page cannot give {', '.join(mixed)}", "leave it out")
        try:
            return self.line_of(method).ask(method, params, LATE_S if method in ASKED else None)
        except RpcError as error:
            hint = str(error.data.get("hint") or "")
            raise Refused(409, str(error.data.get("reason") or error.message), hint) from error
        except DaemonUnavailable as error:
            raise Refused(503, str(error), "see that `legato serve` runs") from error
