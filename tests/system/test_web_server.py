"""The page's server without a browser: what it refuses, what it reads, and how it ends."""

import http.client
import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import connect
from websockets.typing import Origin

from legato.daemon.keys import make_keys
from tests.system.process import Daemon, daemon
from tests.system.site import Site, cell, site


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Daemon, Site]]:
    """Give a daemon and a page server."""
    config = cell(tmp_path_factory.mktemp("cell"), {"seed": 1, "time_scale": 100.0})
    with daemon(config) as cell_daemon, site(config) as served:
        yield cell_daemon, served


def ask(
    served: Site, method: str, path: str, body: Any = None, **headers: str
) -> tuple[int, Any, dict[str, str]]:
    """Return status, document or text, and headers of one answer."""
    line = http.client.HTTPConnection("127.0.0.1", served.port, timeout=20.0)
    text = None if body is None else json.dumps(body)
    line.request(method, path, text, {name.replace("_", "-"): v for name, v in headers.items()})
    answer = line.getresponse()
    read = answer.read()
    told = dict(answer.getheaders())
    line.close()
    is_json = told.get("content-type") == "application/json"
    return answer.status, json.loads(read) if is_json else read, told


def bearer(served: Site) -> str:
    """Return the header that lets act."""
    return f"Bearer {served.token}"


def test_a_rebound_name_or_a_foreign_page_gets_nothing(running: tuple[Daemon, Site]) -> None:
    """Neither page, live line nor act, with the right token or without."""
    cell_daemon, served = running
    before = cell_daemon.do("sessions")["sessions"]
    key = bearer(served)
    for path in ("/", "/live", "/static/page.css", "/api/me"):
        assert ask(served, "GET", path, Host="evil.example", Authorization=key)[0] == 403
    foreign = {"Origin": "http://evil.example", "Authorization": key}
    assert ask(served, "POST", "/api/act/run", {}, **foreign)[0] == 403
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec_WebSocket_Version": "13",
               "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ=="}  # fmt: skip
    for origin in ({"Origin": "http://evil.example"}, {}):
        assert ask(served, "GET", "/live", **upgrade, **origin)[0] == 403
    begun = [session["id"] for session in cell_daemon.do("sessions")["sessions"]]
    assert begun == [session["id"] for session in before]


def test_without_the_token_a_page_only_looks_on(running: tuple[Daemon, Site]) -> None:
    """The page is served, every act is refused with what to do, stop among them."""
    cell_daemon, served = running
    status, page, told = ask(served, "GET", "/")
    assert status == 200
    assert b"<title>legato</title>" in page
    assert "default-src 'none'" in told["content-security-policy"]
    for method in ("run", "stop", "estop", "reset"):
        for shown in ({}, {"Authorization": "Bearer wrong"}):
            status, answer, _ = ask(served, "POST", f"/api/act/{method}", {}, **shown)
            assert status == 401
            assert "token" in answer["hint"]
    assert ask(served, "POST", "/api/snap", {})[0] == 401
    assert cell_daemon.do("status")["fault"] is None


def test_what_the_daemon_refuses_is_told_with_its_reason(running: tuple[Daemon, Site]) -> None:
    """Refusals keep reason and hint; what no page may ask for is unknown here."""
    _, served = running
    key = bearer(served)
    status, told, _ = ask(served, "POST", "/api/act/resume", {}, Authorization=key)
    assert (status, told["hint"]) == (409, "nothing is paused")
    picks = {"picks": {"P99": [1.0, 2.0]}}
    ask(served, "POST", "/api/act/capture", {}, Authorization=key)
    for method, body, wanted in (
        ("shutdown", {}, 404), ("lease", {}, 404), ("run", [], 400),
        ("calibrate", {"picks": {}}, 409), ("calibrate", picks, 409), ("run", {"x": 1}, 409),
        ("home", {"method": "x"}, 400), ("home", {"self": 1}, 400), ("run", {"expires_at": 1}, 400),
        ("stop", {"timeout_s": "long"}, 400), ("end_campaign", {}, 409),
    ):  # fmt: skip
        status, told, _ = ask(served, "POST", f"/api/act/{method}", body, Authorization=key)
        assert (status, bool(told["reason"])) == (wanted, True)
    assert ask(served, "POST", "/api/act/run", "x" * 100_000, Authorization=key)[0] == 413


def test_stop_is_confirmed_by_the_stop_line(running: tuple[Daemon, Site]) -> None:
    """The answer has the stop line's three times."""
    _, served = running
    _, told, _ = ask(served, "POST", "/api/act/stop", {}, Authorization=bearer(served))
    assert told["received"] <= told["commanded"] <= told["confirmed"]


def test_only_sessions_pictures_and_reports_are_read(running: tuple[Daemon, Site]) -> None:
    """A report is a page of its own that runs no script; other files are out of reach."""
    cell_daemon, served = running
    while cell_daemon.do("status")["state"] != "idle":
        continue  # a stop was given before
    session = cell_daemon.do("capture")["session"]
    assert cell_daemon.wait(session) == "done"
    status, picture, _ = ask(served, "GET", f"/sessions/{session}/frames/capture.png")
    assert (status, picture[:4]) == (200, b"\x89PNG")
    status, page, told = ask(served, "GET", f"/sessions/{session}/report")
    assert status == 200
    assert session.encode() in page
    assert "sandbox" in told["content-security-policy"]
    assert "script" not in told["content-security-policy"]
    for path in (
        f"/sessions/{session}/frames/..%2Fsession.json", f"/sessions/{session}/frames/x.png",
        "/sessions/../report", "/sessions/20200101T000000Z-0000/report", "/sessions/x/report",
        "/static/../acts.py", "/static/%2e%2e/acts.py", "/etc/passwd",
    ):  # fmt: skip
        assert ask(served, "GET", path)[0] == 404, path


def test_a_page_may_no_more_than_its_servers_key(tmp_path: Path) -> None:
    """Over encrypted lines an observer's page sees everything, and asks for nothing."""
    secret, public = make_keys(tmp_path, "cell", "server")
    mine, _ = make_keys(tmp_path / "clients", "eve", "observer")
    keys = {
        "curve": {"secret": str(secret), "clients": str(tmp_path / "clients")},
        "client_secret": str(mine),
        "server_public": str(public),
    }
    config = cell(tmp_path, {}, server=keys)
    with serving(config), site(config) as served:
        at = served.address.split("/")[2]
        with connect(f"ws://{at}/live", origin=Origin(f"http://{at}")) as line:
            known: dict[str, Any] = {}
            while not (known.get("line", {}).get("up") and "status" in known):
                known |= json.loads(line.recv(timeout=20.0))
        assert known["status"]["state"] == "idle"
        assert known["cell"]["stations_mm"] == [7.0, 67.0, 127.0, 187.0]
        key = bearer(served)
        told = ask(served, "GET", "/api/me", Authorization=key)[1]
        assert told == {"may": [], "role": "observer"}
        status, told, _ = ask(served, "POST", "/api/act/stop", {}, Authorization=key)
        assert (status, told["reason"]) == (403, "stop is not for role observer")


@contextmanager
def serving(config: Path) -> Iterator[None]:
    """Let a daemon run whose lines are encrypted: no plain client can look at it."""
    command = [sys.executable, "-m", "legato", "serve", "--config", str(config)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.terminate()


def test_a_server_that_observes_prints_no_token(tmp_path: Path) -> None:
    """With --observe nobody acts, and without a daemon the page is served all the same."""
    with site(cell(tmp_path, {}), "--observe") as served:
        assert served.token is None
        assert served.url == served.address
        assert ask(served, "GET", "/")[0] == 200
        assert ask(served, "POST", "/api/act/stop", {}, Authorization="Bearer None")[0] == 403
        command = [sys.executable, "-m", "legato", "web", "--port", str(served.port)]
        second = subprocess.run(command, capture_output=True, text=True, check=False)
        assert second.returncode == 1
        assert "another `legato web` may run" in second.stderr
        assert served.close() in (0, -15)
