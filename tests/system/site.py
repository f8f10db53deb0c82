"""`legato web` as a process beside a daemon, and a browser that looks at it."""

import json
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from legato.config.load import load
from legato.config.toml import dumps
from tests.system.process import configuration

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# Software rendering for the 3-D view; no talk with the browser's maker.
FLAGS = (
    "--no-sandbox", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--no-first-run", "--enable-unsafe-swiftshader",
)  # fmt: skip
RUN = ["capture", "calibrate", "verify", "move_home", "massage_7", "massage_67", "massage_127",
       "massage_187", "move_home", "idle"]  # fmt: skip
PASSES = tuple(RUN[4:8])
LOOK = """
window.seenStates = [];
window.contradictions = [];
addEventListener('DOMContentLoaded', () => {
  const look = () => {
    const state = document.body.dataset.state;
    if (state && window.seenStates.at(-1) !== state) window.seenStates.push(state);
    const doing = document.querySelector('#doing')?.textContent ?? '';
    const pressing = /press|draw/.test(doing) && !state.startsWith('massage_');
    if (pressing) window.contradictions.push(`${state}: ${doing}`);
  };
  const text = {childList: true, characterData: true, subtree: true};
  new MutationObserver(look).observe(document.querySelector('#doing'), text);
  new MutationObserver(look).observe(document.body, {attributeFilter: ['data-state']});
});
"""


def cell(folder: Path, sim: dict[str, Any], **tables: dict[str, Any]) -> Path:
    """Write the configuration of a simulated cell whose lines have ports that are known before."""
    path = configuration(folder, dict(zip(("requests", "events", "stop"), _free(3), strict=True)))
    data = load(path).data
    for name, table in {"sim": sim, **tables}.items():
        data[name] |= table
    path.write_text(dumps(data, "Made by a test."), encoding="utf-8")
    return path


class Site:
    """A running `legato web`; `url` has the token, `address` has not."""

    def __init__(self, config: Path, *options: str) -> None:
        command = [sys.executable, "-m", "legato", "web", "--port", "0", "--json"]
        self.process = subprocess.Popen(
            [*command, "--config", str(config), *options], stdout=subprocess.PIPE, text=True,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        assert self.process.stdout is not None
        told: dict[str, Any] = json.loads(self.process.stdout.readline())
        self.url, self.address, self.token = told["url"], told["address"], told["token"]

    @property
    def port(self) -> int:
        """The port on loopback."""
        return int(self.address.rstrip("/").rpartition(":")[2])

    def close(self) -> int:
        """End the process and return its code."""
        self.process.terminate()
        try:
            return self.process.wait(10.0)
        finally:
            self.process.kill()
            self.process.wait()
            assert self.process.stdout is not None
            self.process.stdout.close()


@contextmanager
def site(config: Path, *options: str) -> Iterator[Site]:
    """Give a running page server; it ends with this."""
    running = Site(config, *options)
    try:
        yield running
    finally:
        running.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Give a headless browser: the machine's, or the one that playwright has installed."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    with sync_playwright() as play:
        running = play.chromium.launch(executable_path=found, args=list(FLAGS))
        yield running
        running.close()


@contextmanager
def page_of(browser: Browser, url: str, line: str = "up", **options: Any) -> Iterator[Page]:
    """Give a page whose line stands as told; errors of its scripts fail the test."""
    context = browser.new_context(**{"viewport": {"width": 1280, "height": 900}} | options)
    context.set_default_timeout(20_000)
    errors: list[str] = []
    page = context.new_page()
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.add_init_script(LOOK)
    page.goto(url)
    page.locator(f"body[data-line={line}]").wait_for(state="attached")
    try:
        yield page
        assert errors == []
    finally:
        context.close()


def until_state(page: Page, *states: str) -> None:
    """Wait until the page shows one of some states."""
    wanted = ", ".join(f"body[data-state={state}]" for state in states)
    page.locator(wanted).wait_for(state="attached")


def _free(count: int) -> list[str]:
    """Return endpoints whose ports are free at this moment."""
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    found = [f"tcp://127.0.0.1:{one.getsockname()[1]}" for one in sockets]
    for one in sockets:
        one.close()
    return found
