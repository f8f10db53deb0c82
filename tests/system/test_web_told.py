"""What the page says of failed stops, campaigns, progress, and keys that may not act."""

import re
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from legato.daemon.keys import make_keys
from tests.system.process import Daemon, daemon
from tests.system.site import PASSES, Site, browser, cell, page_of, site, until_state
from tests.system.test_web_server import serving

__all__ = ["browser"]

expect.set_options(timeout=15_000)


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Daemon, Site]]:
    """Give a daemon and a page server."""
    config = cell(tmp_path_factory.mktemp("cell"), {"seed": 1, "time_scale": 20.0})
    with daemon(config) as cell_daemon, site(config) as served:
        yield cell_daemon, served


def test_a_stop_that_fails_stays_until_one_is_answered(
    running: tuple[Daemon, Site], browser: Browser
) -> None:
    """Of a frozen daemon: through the loss of its line and its return, large and read out.

    Before that, of a pass that is held: the stroke that is under way is not counted as done.
    """
    cell_daemon, served = running
    cell_daemon.ready_to_massage()
    with page_of(browser, served.url) as page:
        failed = page.get_by_role("alert").locator("strong")
        page.get_by_role("button", name="Massage", exact=True).click()
        expect(page.locator("#meter")).to_be_visible()
        page.keyboard.press("Alt+KeyP")
        until_state(page, "paused")
        begun = cell_daemon.do("status")["progress"]["done"]
        expect(page.locator("#doing")).to_contain_text(f"stroke {begun} of 12")
        expect(page.locator("#meter")).to_have_attribute("aria-valuenow", str(begun - 1))
        page.keyboard.press("Alt+KeyP")
        until_state(page, *PASSES)
        cell_daemon.process.send_signal(signal.SIGSTOP)
        try:
            page.keyboard.press("Escape")
            expect(failed).to_contain_text("Use the hardware stop.")
            page.locator("body[data-line=lost]").wait_for(state="attached")
            expect(failed).to_have_text("Stop was not carried out. Use the hardware stop.")
            assert in_sight(page, "#unstopped")
        finally:
            cell_daemon.process.send_signal(signal.SIGCONT)
        page.locator("body[data-line=up]").wait_for(state="attached")
        until_state(page, *PASSES)
        expect(failed).to_have_text("Stop was not carried out. Use the hardware stop.")
        page.keyboard.press("Escape")
        expect(failed).to_have_count(0)
        expect(page.locator("#said")).to_contain_text("stop given")
        until_state(page, "idle")


def test_between_its_repetitions_a_cell_is_the_campaigns(
    running: tuple[Daemon, Site], browser: Browser
) -> None:
    """Nothing looks possible that would be refused; the campaign is ended from here.

    What was told of an earlier act goes with the session that others begin.
    """
    cell_daemon, served = running
    cell_daemon.to_idle()
    with page_of(browser, served.url) as page:
        run = page.get_by_role("button", name="Run", exact=True)
        end = page.get_by_role("button", name="End campaign")
        expect(end).to_have_count(0)
        page.keyboard.press("Escape")
        expect(page.locator("#said")).to_contain_text("stop given")
        begun = cell_daemon.do("campaign", job="capture", count=2, every_s=4000.0)
        expect(page.locator("#said")).to_be_empty()
        cell_daemon.wait(begun["session"])
        until_state(page, "idle")
        expect(run).to_have_attribute("title", re.compile("campaign .* is under way; stop, or end"))
        for name in ("Run", "Capture", "Home", "Reference"):
            button = page.get_by_role("button", name=name, exact=True)
            expect(button).to_have_attribute("aria-disabled", "true")
        expect(page.get_by_role("button", name="Mark by hand")).to_have_count(0)
        end.click()
        expect(page.locator("#said")).to_have_text(f"campaign {begun['campaign']} ends")
        expect(run).to_have_attribute("aria-disabled", "false")
        expect(end).to_have_count(0)
        expect(page.locator("#known")).to_contain_text("stopped")


def test_a_page_says_whose_key_it_is_that_may_not_act(tmp_path: Path, browser: Browser) -> None:
    """An observer's page is not told to look for a token; a refused key's offers no stop."""
    secret, public = make_keys(tmp_path, "cell", "server")
    mine, _ = make_keys(tmp_path / "clients", "eve", "observer")
    other, _ = make_keys(tmp_path / "strangers", "mallory", "operator")
    keys = {"curve": {"secret": str(secret), "clients": str(tmp_path / "clients")},
            "client_secret": str(mine), "server_public": str(public)}  # fmt: skip
    config = cell(tmp_path, {}, server=keys)
    with serving(config):
        with site(config) as served, page_of(browser, served.url) as page:
            told = page.locator("#alerts .quiet")
            expect(told).to_contain_text("an observer\u2019s")
            expect(told).to_contain_text("use the hardware stop")
            expect(told).not_to_contain_text("open the address")
        text = config.read_text(encoding="utf-8").replace(str(mine), str(other))
        config.write_text(text, encoding="utf-8")
        with site(config) as served, page_of(browser, served.url, line="lost") as page:
            region = page.get_by_role("region", name="Connection")
            expect(region).to_contain_text("key refused")
            expect(region).to_contain_text("has not been heard yet")
            expect(page.locator("#hardware")).to_be_visible()
            expect(region).not_to_contain_text("Stop and E-stop reach it")
            expect(page.locator("#contacts")).to_contain_text("Nothing touched yet")
            page.keyboard.press("Escape")
            failed = page.get_by_role("alert").locator("strong")
            expect(failed).to_have_text("Stop was not carried out. Use the hardware stop.")


def in_sight(page: Page, one: str) -> bool:
    """Say whether an element is in the window wherever the page is scrolled to."""
    page.evaluate("scrollTo(0, document.body.scrollHeight)")
    box = page.locator(one).bounding_box()
    return box is not None and 0 <= box["y"] < 300
