"""Who may talk to the page's server: hosts, origins, and the headers that go with answers."""

import asyncio
from typing import Any

import pytest
from starlette.types import Receive, Scope, Send

from legato.web.guard import HEADERS, Guard, hosts

OWN = (b"host", b"127.0.0.1:5765")


async def page(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer everything, with a policy of its own where the path says so."""
    del receive
    own = [(b"content-security-policy", b"sandbox")] if scope["path"] == "/own" else []
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        return
    await send({"type": "http.response.start", "status": 200, "headers": own})
    await send({"type": "http.response.body", "body": b""})


def asked(kind: str, *headers: tuple[bytes, bytes], path: str = "/") -> dict[str, Any]:
    """Return the first message that a connection is answered with."""
    sent: list[dict[str, Any]] = []

    async def send(message: Any) -> None:
        sent.append(dict(message))

    async def receive() -> Any:
        return {"type": "http.request"}

    scope = {"type": kind, "headers": list(headers), "path": path, "method": "GET"}
    asyncio.run(Guard(page, hosts(5765))(scope, receive, send))
    return sent[0]


@pytest.mark.parametrize(
    "headers",
    [
        [],
        [(b"host", b"evil.example")],
        [(b"host", b"evil.example:5765")],
        [(b"host", b"127.0.0.1:80")],
        [(b"host", b"127.0.0.1:5765.evil.example")],
        [OWN, (b"host", b"evil.example")],
        [OWN, (b"origin", b"http://evil.example")],
        [OWN, (b"origin", b"null")],
        [OWN, (b"origin", b"https://127.0.0.1:5765")],
    ],
)
def test_whatever_is_not_our_own_page_is_refused(headers: list[tuple[bytes, bytes]]) -> None:
    """Rebound names, foreign origins and doubled hosts get 403, and no live line."""
    assert asked("http", *headers)["status"] == 403
    assert asked("websocket", *headers) == {"type": "websocket.close", "code": 1008}


@pytest.mark.parametrize("host", ["127.0.0.1:5765", "localhost:5765", "[::1]:5765"])
def test_our_own_page_is_let_in_by_each_of_its_names(host: str) -> None:
    """With its own origin or, for a plain request, with none."""
    named = (b"host", host.encode())
    origin = (b"origin", f"http://{host}".encode())
    assert asked("http", named)["status"] == 200
    assert asked("http", named, origin)["status"] == 200
    assert asked("websocket", named, origin) == {"type": "websocket.accept"}


def test_a_live_line_must_say_where_it_comes_from() -> None:
    """Browsers always do."""
    assert asked("websocket", OWN)["type"] == "websocket.close"


def test_every_answer_carries_the_policy_but_for_one_that_has_its_own() -> None:
    """A report's own policy is stricter in scripts and looser in styles."""
    told = dict(asked("http", OWN)["headers"])
    assert told == {k.encode(): v.encode() for k, v in HEADERS.items()}
    policies = [v for k, v in asked("http", OWN, path="/own")["headers"] if b"policy" in k]
    assert b"sandbox" in policies
    assert HEADERS["content-security-policy"].encode() not in policies


def test_the_policy_lets_no_inline_script_and_no_other_host_in() -> None:
    """Neither scripts nor styles inline, nothing from elsewhere."""
    policy = HEADERS["content-security-policy"]
    assert "unsafe" not in policy
    assert "default-src 'none'" in policy
    assert "http" not in policy
