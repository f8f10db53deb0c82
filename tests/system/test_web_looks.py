"""The page for every eye and hand: axe finds nothing serious, nothing is cut off, keys suffice."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.system.process import Daemon, daemon
from tests.system.site import Site, browser, cell, page_of, site, until_state

__all__ = ["browser"]

AXE = Path(__file__).resolve().parents[1] / "vendor" / "axe-core" / "axe.min.js"
SIZES = {1280: 900, 390: 844}
CHECK = """async () => (await axe.run(document, {
        resultTypes: ['violations'], rules: {'target-size': {enabled: true}},
    })).violations.filter((v) => v.impact !== 'minor')
    .map((v) => `${v.id}: ${v.nodes.map((n) => n.html + ' ' + n.failureSummary).join(' | ')}`)"""
# What sticks out to the right of the page.
WIDE = "document.documentElement.scrollWidth - document.documentElement.clientWidth"


# The boxes of the names over the picture, in its px, and the size of the picture.
NAMES = """() => {
    const svg = document.querySelector('#picture svg');
    const boxes = [...svg.querySelectorAll('text')].map((t) => [t.textContent, t.getBBox()]);
    return [boxes.map(([text, b]) => [text, b.x, b.y, b.x + b.width, b.y + b.height]),
        [svg.viewBox.baseVal.width, svg.viewBox.baseVal.height]];
}"""


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Daemon, Site]]:
    """Give a daemon that has found the leg, and a page server."""
    config = cell(tmp_path_factory.mktemp("cell"), {"seed": 1, "time_scale": 400.0})
    with daemon(config) as cell_daemon, site(config) as served:
        cell_daemon.wait(cell_daemon.do("run")["session"])
        yield cell_daemon, served


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_finds_nothing_serious_and_nothing_is_cut_off(
    running: tuple[Daemon, Site], browser: Browser, theme: str
) -> None:
    """Wide and narrow; idle, while marking, in fault, with no daemon's word believed."""
    cell_daemon, served = running
    with page_of(browser, served.url, color_scheme=theme) as page:
        expect(page.locator("#picture svg .seen").first).to_be_attached()
        page.evaluate(AXE.read_text(encoding="utf-8"))
        sound(page, "idle")
        page.locator("#mark").click()
        sound(page, "marking")
        cell_daemon.do("estop")
        until_state(page, "fault")
        page.get_by_text("Evidence").click()
        sound(page, "fault")
        cell_daemon.do("reset")
        until_state(page, "idle")


@pytest.mark.parametrize("width", SIZES)
def test_every_name_in_the_picture_can_be_read(
    running: tuple[Daemon, Site], browser: Browser, width: int
) -> None:
    """None is cut off at the picture's edge, none lies over another."""
    _, served = running
    view = {"width": width, "height": SIZES[width]}
    with page_of(browser, served.url, viewport=view) as page:
        expect(page.locator("#picture svg text")).to_have_count(14)
        names, (w, h) = page.evaluate(NAMES)
    for name, left, top, right, bottom in names:
        assert left >= 0 and top >= 0 and right <= w and bottom <= h, name  # noqa: PT018
    for one, left, top, right, bottom in names:
        for other, a, b, c, d in names:
            # A line's box is taller than its letters: a fifth may be shared.
            slack = 0.2 * (bottom - top)
            apart = right <= a or c <= left or bottom - slack <= b or d - slack <= top
            assert one == other or apart, (one, other)


def test_a_page_without_the_token_says_why_it_cannot_act(
    running: tuple[Daemon, Site], browser: Browser
) -> None:
    """Buttons are there and say why they do nothing; the page is sound all the same."""
    _, served = running
    with page_of(browser, served.address) as page:
        page.evaluate(AXE.read_text(encoding="utf-8"))
        sound(page, "looking on")
        page.keyboard.press("Escape")
        expect(page.locator("#urgent")).to_contain_text("open the address with the token")
        assert page.locator("#alerts").get_by_text("only looks on").is_visible()
        assert page.locator("#alerts").get_by_text("use the hardware stop").is_visible()


def test_the_keyboard_reaches_everything_and_stop_comes_first(
    running: tuple[Daemon, Site], browser: Browser
) -> None:
    """From the top: skip link, stop, emergency stop, requests in their order; focus is seen."""
    _, served = running
    with page_of(browser, served.url) as page:
        reached = []
        for _ in range(6):
            page.keyboard.press("Tab")
            reached.append(page.evaluate("document.activeElement.textContent.trim()"))
            outline = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
            assert outline != "none", reached
        assert [text.split()[0] for text in reached] == [
            "Skip", "Stop", "E-stop", "Run", "Capture", "Calibrate",
        ]  # fmt: skip


def sound(page: Page, where: str) -> None:
    """Assert that the page is sound at both widths."""
    for width, height in SIZES.items():
        page.set_viewport_size({"width": width, "height": height})
        assert page.evaluate(CHECK) == [], (where, width)
        assert page.evaluate(WIDE) <= 0, (where, width)
