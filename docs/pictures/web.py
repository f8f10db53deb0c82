"""Make README's pictures of the live page anew: `python docs/pictures/web.py`, with chromium.

Runs a daemon on the simulated cell and `legato web` in a folder of their own, presses Run, and
photographs the page during a pass: wide and light, narrow and dark.
"""

import json
import shutil
import socket
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from legato.config.load import load
from legato.config.toml import dumps

HERE = Path(__file__).resolve().parent
LINES = ("requests", "events", "stop")


def main() -> None:
    """Write web.png and web-narrow.png beside this file."""
    with tempfile.TemporaryDirectory() as name, ExitStack() as processes:
        config = configuration(Path(name))
        for command in ("serve", "web"):
            line = [sys.executable, "-m", "legato", command, "--config", str(config)]
            more = ["--port", "0", "--json"] if command == "web" else []
            process = subprocess.Popen(
                [*line, *more], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
            )
            processes.callback(process.wait)
            processes.callback(process.terminate)
        assert process.stdout is not None
        photograph(json.loads(process.stdout.readline())["url"])


def configuration(folder: Path) -> Path:
    """Write a simulated cell whose lines have free ports; return its file."""
    data = {table: dict(values) for table, values in load().data.items()}
    with ExitStack() as held:
        sockets = [held.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in LINES]
        ports = [s.getsockname()[1] for s in sockets]
    data["server"] = {n: f"tcp://127.0.0.1:{p}" for n, p in zip(LINES, ports, strict=True)}
    data["records"] |= {"state_dir": str(folder / "state")}
    data["sim"] |= {"time_scale": 10.0}
    path = folder / "cell.toml"
    path.write_text(dumps(data, "Made for a picture."), encoding="utf-8")
    return path


def photograph(url: str) -> None:
    """Photograph the page during a run, and afterwards."""
    with sync_playwright() as play:
        path = shutil.which("chromium")
        browser = play.chromium.launch(
            executable_path=path, args=["--no-sandbox", "--enable-unsafe-swiftshader"]
        )
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(url)
        state(page, "idle")
        page.get_by_role("button", name="Run").click()
        state(page, "massage_127")
        page.locator("#contacts svg .touch").nth(7).wait_for(state="attached")
        page.screenshot(path=HERE / "web.png", clip=box(page, 1280), full_page=True)
        state(page, "idle")
        page.set_viewport_size({"width": 390, "height": 844})
        page.emulate_media(color_scheme="dark")
        page.locator("#h-arm").scroll_into_view_if_needed()
        page.evaluate("document.querySelector('#h-picture').scrollIntoView()")
        page.wait_for_timeout(500)
        page.screenshot(path=HERE / "web-narrow.png")
        browser.close()


def state(page: Page, name: str) -> None:
    """Wait until the page shows a state."""
    page.locator(f"body[data-state={name}]").wait_for(state="attached", timeout=90_000)


def box(page: Page, width: int) -> dict[str, float]:
    """Return the page down to where the lists begin."""
    tall = page.evaluate("document.querySelector('#h-sessions').closest('section').offsetTop")
    return {"x": 0, "y": 0, "width": width, "height": tall}


if __name__ == "__main__":
    main()
