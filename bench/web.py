"""The live page in a browser: telemetry, contact to screen, what it costs at rest, the daemon.

One real page follows a run in headless Chromium; ten are open where the daemon's latency is held
against none, turn about in one run. The browser renders in software here: its own share of a core
is told without an aim.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Browser, Page, sync_playwright

from bench.daemon import round_trips
from bench.process import megabytes, serving
from bench.row import Row, keep
from legato.daemon.client import Client

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--no-sandbox", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--no-first-run", "--enable-unsafe-swiftshader",
)  # fmt: skip
PAGES, ROUNDS, REST_S, RUNS = 10, 4, 10.0, 3
SHOWN_SHARE, SCREEN_MS, REST_PERCENT, MEMORY_MB = 0.95, 200.0, 5.0, 200.0
STANDING_S = 0.25  # between two places: the arm stood
SAME_P50, SAME_P99 = 1.1, 1.5
SHARED_P50 = 1.25  # where ten readers share two cores with a running job

# Notes when each contact and each place of the arm is on the screen: a frame after it was drawn.
WATCH = """
window.contactsAt = []; window.placesAt = [];
addEventListener('DOMContentLoaded', () => {
  const frame = (then) => requestAnimationFrame(then);
  const shown = (then) => frame(() => frame(() => then(Date.now())));
  let contacts = 0;
  new MutationObserver(() => {
    const now = document.querySelectorAll('#contacts svg .touch').length;
    if (now < contacts) contacts = 0;
    for (; contacts < now; contacts++) shown((at) => contactsAt.push(at));
  }).observe(document.getElementById('contacts'), {childList: true});
  let place = '';
  new MutationObserver(() => {
    const now = document.querySelector('#readings dd').textContent;
    if (now !== place) placesAt.push([Date.now(), place = now]);
  }).observe(document.getElementById('readings'),
             {childList: true, subtree: true, characterData: true});
});
"""
LINES = """
import asyncio, sys
from websockets.asyncio.client import connect
async def read(address):
    async with connect(f"ws://{address}/live", origin=f"http://{address}") as line:
        async for _ in line:
            pass
async def main():
    await asyncio.gather(*(read(sys.argv[1]) for _ in range(int(sys.argv[2]))))
asyncio.run(main())
"""


def run() -> list[Row]:
    """Return the page's figures."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name, serving(Path(name) / "cell", None) as ends:
        config = Path(name) / "cell" / "cell.toml"
        with site(config) as (told, pid), browser() as running:
            with opened(running, told["url"]) as page:
                rows += follows(ends, page)
                rows += rests(pid)
            rows += unslowed(ends, running, told)
    keep("web", rows)
    return rows


def follows(ends: Mapping[str, str], page: Page) -> Iterator[Row]:
    """Yield how a page keeps up with runs: what is shown, and how soon a contact is."""
    late: list[float] = []
    sent = shown = 0
    seconds = 0.0
    for _ in range(RUNS):
        page.evaluate("contactsAt.length = placesAt.length = 0")
        contacts, places = heard(ends)
        drawn = page.evaluate("[contactsAt, placesAt]")
        assert len(drawn[0]) == len(contacts), "every contact is shown"
        late += [at - 1e3 * since for at, since in zip(drawn[0], contacts, strict=True)]
        moving = [b - a for a, b in pairwise(places) if b - a < STANDING_S]
        sent, shown, seconds = sent + len(moving), shown + len(drawn[1]), seconds + sum(moving)
    sent_hz = sent / seconds
    yield Row("web: places of the arm sent a second while it moves", sent_hz, "Hz")
    yield Row("web: places shown, of those sent", shown / sent, "", SHOWN_SHARE, at_least=True,
              note=f"{sent} sent")  # fmt: skip
    yield Row("web: contact event to screen, median", float(np.median(late)), "ms")
    yield Row("web: contact event to screen, longest", float(np.max(late)), "ms", SCREEN_MS,
              note=f"{len(late)} contacts")  # fmt: skip


def heard(ends: Mapping[str, str]) -> tuple[list[float], list[float]]:
    """Run a job; return when its contacts and its new places of the arm reached a subscriber."""
    contacts, places, last = [], [], None
    with Client(ends["requests"], ends["events"]) as client:
        client.call("ping")
        session = client.call("run")["session"]
        for topic, event in client.events(5.0):
            if event.get("session") != session:
                continue
            if topic == "contact":
                contacts.append(time.time())
            elif topic == "telemetry" and rounded(event["arm"]["xyz_mm"]) != last:
                last = rounded(event["arm"]["xyz_mm"])
                places.append(time.time())
            elif topic == "session" and event["outcome"] is not None:
                break
    time.sleep(1.0)
    return contacts, places


def rounded(xyz: list[float]) -> list[float]:
    """Return a place as the page writes it."""
    return [round(v, 1) for v in xyz]


def rests(pid: int) -> Iterator[Row]:
    """Yield what the page costs while the cell is idle."""
    before, browsers = seconds_of(pid), seconds_below(os.getpid(), pid)
    time.sleep(REST_S)
    spent = 100.0 * (seconds_of(pid) - before) / REST_S
    drawing = 100.0 * (seconds_below(os.getpid(), pid) - browsers) / REST_S
    yield Row("web: server at rest, share of a core", spent, "%", REST_PERCENT)
    yield Row("web: browser, daemon and bench at rest, share of a core", drawing, "%")
    yield Row("web: server's memory", megabytes(pid), "MB", MEMORY_MB)


def unslowed(ends: Mapping[str, str], running: Browser, told: Mapping[str, Any]) -> Iterator[Row]:
    """Yield the daemon's status latency with ten pages open over that with none, idle and busy."""
    alone: list[float] = []
    watched: list[float] = []
    with Client(ends["requests"]) as client:
        for _ in range(ROUNDS):
            alone += settled(client)
            context = running.new_context()
            for _ in range(PAGES):
                look(context.new_page(), told["url"])
            watched += settled(client)
            context.close()
        yield from ratios("idle, ten pages in a browser", watched, alone, SAME_P50)
        alone, watched = [], []
        for _ in range(ROUNDS):
            alone += busy(client)
            with lines(told["address"]):
                watched += busy(client)
        yield from ratios("during a massage, ten live lines", watched, alone, SHARED_P50)


def ratios(what: str, watched: list[float], alone: list[float], middle: float) -> Iterator[Row]:
    """Yield two rows: the middle and the slow end."""
    for share, limit in ((50, middle), (99, SAME_P99)):
        with_pages, without = np.percentile(watched, share), np.percentile(alone, share)
        ratio = float(with_pages / without)
        note = f"{1e6 * with_pages:.0f} us over {1e6 * without:.0f} us"
        yield Row(f"web: status with over without, {what}, p{share}", ratio, "", limit, note=note)


def settled(client: Client) -> list[float]:
    """Return round trips once what was opened or closed has come to rest."""
    time.sleep(2.0)
    return [t for _ in range(8) for t in round_trips(client)[20:]]


def busy(client: Client) -> list[float]:
    """Return round trips of status during a massage."""
    session = client.call("massage")["session"]
    found: list[float] = []
    while client.call("wait", session=session, timeout_s=0.0)["outcome"] is None:
        began = time.perf_counter()
        client.call("status")
        found.append(time.perf_counter() - began)
        time.sleep(0.002)
    return found


@contextmanager
def lines(address: str) -> Iterator[None]:
    """Let ten live lines be read in a process of their own."""
    at = address.split("/")[2]
    with subprocess.Popen([sys.executable, "-c", LINES, at, str(PAGES)]) as process:
        time.sleep(1.0)
        try:
            yield
        finally:
            process.kill()


@contextmanager
def site(config: Path) -> Iterator[tuple[dict[str, Any], int]]:
    """Give what a running `legato web` has told, and its process id."""
    command = [sys.executable, "-m", "legato", "web", "--port", "0", "--json", "--config"]
    process = subprocess.Popen([*command, str(config)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        told = json.loads(process.stdout.readline())
        yield told, process.pid
    finally:
        process.terminate()
        process.wait(10.0)
        process.stdout.close()


@contextmanager
def browser() -> Iterator[Browser]:
    """Give a headless browser."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    with sync_playwright() as play:
        running = play.chromium.launch(executable_path=found, args=list(FLAGS))
        yield running
        running.close()


@contextmanager
def opened(running: Browser, url: str) -> Iterator[Page]:
    """Give a page that watches itself."""
    context = running.new_context(viewport={"width": 1280, "height": 900})
    page = context.new_page()
    page.add_init_script(WATCH)
    look(page, url)
    yield page
    context.close()


def look(page: Page, url: str) -> None:
    """Open the page and wait for its first word of the cell."""
    page.goto(url)
    page.locator("body[data-line=up]").wait_for(state="attached")


def seconds_of(pid: int) -> float:
    """Return the processor time that a process has taken."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def seconds_below(root: int, without: int) -> float:
    """Return the processor time of a process and all below it, but for one."""
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            text = path.read_text(encoding="utf-8", errors="replace")
        except OSError:
            continue  # it has ended meanwhile
        parents[int(path.parent.name)] = int(text.rpartition(")")[2].split()[1])
    found = {root}
    while more := {p for p, above in parents.items() if above in found} - found:
        found |= more
    total = 0.0
    for pid in found - {without}:
        try:
            total += seconds_of(pid)
        except (OSError, ValueError):
            continue
    return total
