"""Who may talk to this server: pages that it served itself, by a name that means this machine.

A foreign page cannot reach it by a name of its own (Host), nor send anything from elsewhere
(Origin), nor show it in a frame; the page loads nothing from anywhere else.
"""

from collections.abc import Iterable
from typing import Final

from starlette.types import ASGIApp, Message, Receive, Scope, Send

POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
REPORT_POLICY: Final = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; font-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; sandbox"
)
HEADERS: Final = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
    "content-security-policy": POLICY,
}


def hosts(port: int) -> frozenset[str]:
    """Return what a browser on this machine calls a server at `port`."""
    return frozenset(f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]"))


class Guard:
    """Lets in what is asked of one of `allowed` hosts from one of their own pages, else 403."""

    def __init__(self, app: ASGIApp, allowed: Iterable[str]) -> None:
        self._app = app
        self._hosts = frozenset(allowed)
        self._origins = frozenset(f"http://{host}" for host in self._hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one connection."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        if not self._admits(scope):
            await _refuse(scope, send)
            return

        async def dressed(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = {name.lower() for name, _ in message["headers"]}
                more = [(k.encode(), v.encode()) for k, v in HEADERS.items()]
                message["headers"] = [
                    *message["headers"], *(pair for pair in more if pair[0] not in own),
                ]  # fmt: skip
            await send(message)

        await self._app(scope, receive, dressed)

    def _admits(self, scope: Scope) -> bool:
        told = [(n.lower(), v.decode("latin-1").lower()) for n, v in scope["headers"]]
        names = [value for name, value in told if name == b"host"]
        if len(names) != 1 or names[0] not in self._hosts:
            return False
        origins = [value for name, value in told if name == b"origin"]
        if any(origin not in self._origins for origin in origins):
            return False
        # A browser names the origin of whatever could do harm; a program that does not shows a
        # token instead.
        return scope["type"] == "http" or bool(origins)


async def _refuse(scope: Scope, send: Send) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    body = b"This page is served to this machine alone: open it by its own address.\n"
    head = [(b"content-type", b"text/plain; charset=utf-8")]
    await send({"type": "http.response.start", "status": 403, "headers": head})
    await send({"type": "http.response.body", "body": body})
