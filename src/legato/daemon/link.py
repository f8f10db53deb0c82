"""One socket of a client with the monitor that says what became of it: nothing hangs in silence.

One thread uses a link.
"""

import time
from math import ceil
from typing import Any, Final

import zmq
from zmq.utils.monitor import recv_monitor_message

from legato.daemon.keys import Keys
from legato.wire.jsonrpc import CODES

HWM: Final = 10_000
RETRY_MS: Final = 50
LONGEST_RETRY_MS: Final = 500
TRIES: Final = 2  # handshakes that fail without a reason: one may be a daemon that just ended
MISMATCH: Final = "one side encrypts and the other does not, or the daemon has another key"
MISMATCH_HINT: Final = "see server.client_secret and server.server_public; is it this daemon's own?"
WATCHED: Final = (
    zmq.EVENT_DISCONNECTED
    | zmq.EVENT_HANDSHAKE_SUCCEEDED
    | zmq.EVENT_HANDSHAKE_FAILED_NO_DETAIL
    | zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL
    | zmq.EVENT_HANDSHAKE_FAILED_AUTH
)

Context = zmq.Context["zmq.Socket[bytes]"]


class DaemonUnavailable(Exception):
    """No daemon answers at an address, or not in time."""


class RpcError(Exception):
    """The daemon's refusal: code, its name, and data with reason, state and hint."""

    def __init__(self, code: int, message: str, data: "dict[str, Any] | None" = None) -> None:
        self.code = code
        self.message = message
        self.data = data or {}
        reason = self.data.get("reason")
        super().__init__(f"{message} ({code})" + (f": {reason}" if reason else ""))


class KeyRefused(RpcError):
    """The handshake has failed: the daemon does not let this key in, or is another than thought."""

    def __init__(self, endpoint: str, why: str, hint: str) -> None:
        data: dict[str, Any] = {"reason": f"key refused at {endpoint}: {why}", "hint": hint}
        super().__init__(CODES["not_authorised"], "not_authorised", data)


class Link:
    """A socket that is connected, by itself again where the connection was lost.

    Raises KeyRefused as soon as the other side has refused the keys.
    """

    def __init__(self, context: Context, kind: int, endpoint: str, keys: Keys | None) -> None:
        self.endpoint = endpoint
        self._failed = 0
        self._lost = 0
        self.socket = context.socket(kind)
        self.socket.linger = 0
        self.socket.setsockopt(zmq.RCVHWM, HWM)
        self.socket.setsockopt(zmq.RECONNECT_IVL, RETRY_MS)
        self.socket.setsockopt(zmq.RECONNECT_IVL_MAX, LONGEST_RETRY_MS)
        if keys is not None:
            self.socket.setsockopt(zmq.CURVE_PUBLICKEY, keys.public)
            self.socket.setsockopt(zmq.CURVE_SECRETKEY, keys.secret)
            self.socket.setsockopt(zmq.CURVE_SERVERKEY, keys.server)
        self._monitor = self.socket.get_monitor_socket(WATCHED)

    def connect(self) -> None:
        """Begin to connect."""
        self.socket.connect(self.endpoint)

    def wait(self, flag: int, timeout_s: float, *, heed_loss: bool = False) -> bool:
        """Wait until the socket can be read or written, and say whether it can.

        With `heed_loss` a connection that is lost meanwhile raises DaemonUnavailable.
        """
        until = time.monotonic() + timeout_s
        poller = zmq.Poller()
        poller.register(self.socket, flag)
        poller.register(self._monitor, zmq.POLLIN)
        before = self._lost
        while True:
            left = max(until - time.monotonic(), 0.0)
            ready = dict(poller.poll(ceil(left * 1000.0)))
            if self.socket in ready:
                return True
            if self._monitor in ready:
                self._take(recv_monitor_message(self._monitor))
            elif left == 0.0:
                return False
            if heed_loss and self._lost > before:
                raise DaemonUnavailable(f"the daemon at {self.endpoint} has gone unanswering")

    def catch_up(self) -> None:
        """Take in what has become of the socket so far: it is no news to the next wait."""
        while self._monitor.poll(0):
            self._take(recv_monitor_message(self._monitor))

    def close(self) -> None:
        """Let go of the socket."""
        self.socket.disable_monitor()
        self._monitor.close(linger=0)
        self.socket.close(linger=0)

    def _take(self, told: object) -> None:
        """Take in what the monitor says."""
        assert isinstance(told, dict)
        match told["event"]:
            case zmq.EVENT_HANDSHAKE_SUCCEEDED:
                self._failed = 0
            case zmq.EVENT_DISCONNECTED:
                self._lost += 1
            case zmq.EVENT_HANDSHAKE_FAILED_AUTH:
                hint = (
                    "have its .public file put into the daemon's folder of clients, and restart it"
                )
                raise KeyRefused(self.endpoint, "the daemon does not know it", hint)
            case failed:
                # A mismatch is seen as such, or only as a handshake that breaks off: it is a race.
                self._failed += 1
                if failed == zmq.EVENT_HANDSHAKE_FAILED_PROTOCOL or self._failed >= TRIES:
                    raise KeyRefused(self.endpoint, MISMATCH, MISMATCH_HINT)
