"""Make README's picture of `legato watch` anew: `python docs/pictures/terminal.py`, with chromium.

A daemon of its own runs the whole job on the simulated cell; the screen is photographed in the
third pass.
"""

import io
import subprocess
import tempfile
import time
from pathlib import Path

from rich.console import Console

from legato.cli.child import daemon
from legato.cli.demo import derive
from legato.cli.live import Live
from legato.cli.screen import screen
from legato.cli.watch import ask
from legato.config.load import load
from legato.daemon.client import Client

HERE = Path(__file__).resolve().parent
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --hide-scrollbars "
    "--disable-background-networking --disable-component-update --disable-sync"
)
WIDTH, HEIGHT = 118, 32
WHEN = "massage_127"


def main() -> None:
    """Write watch.png beside this file."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shipped, config = load(None), folder / "sim.toml"
        derive(shipped, config, folder, 1, None)
        with daemon(config, folder / "log") as (_, client):
            live = followed(client)
        live.endpoint = shipped.config.server.requests
        console = Console(record=True, width=WIDTH, height=HEIGHT, file=io.StringIO())
        console.print(screen(live, time.monotonic(), WIDTH, HEIGHT), height=HEIGHT)
        page = folder / "watch.svg"
        console.save_svg(str(page), title="legato watch")
        subprocess.run(
            ["chromium", *FLAGS.split(), f"--user-data-dir={folder}/browser",
             "--window-size=1464,880", f"--screenshot={HERE / 'watch.png'}", page.as_uri()],
            check=True, capture_output=True,
        )  # fmt: skip


def followed(client: Client) -> Live:
    """Return what is seen of a run when its third pass has touched."""
    live = Live("")
    client.call("reference", xyz_mm=[127.0, 0.0, 150.0])
    client.call("run")
    ask(client, live)
    while True:
        for topic, event in client.events(1.0):
            live.take(topic, event, time.monotonic())
            if live.state == WHEN and topic == "contact":
                ask(client, live)
                return live


if __name__ == "__main__":
    main()
