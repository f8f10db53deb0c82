"""`legato watch`: the cell as it lives; a full screen on a terminal, a line an event in a pipe."""

import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from legato.cli.command import Context, command
from legato.cli.line import connected
from legato.report.lines import line_of

if TYPE_CHECKING:
    from rich.console import Console

    from legato.cli.live import Live
    from legato.cli.output import Output
    from legato.daemon.client import Client

    Listen = Callable[[Client, Live, Callable[[], None]], None]

QUIET = ("telemetry", "heartbeat")
LISTEN_S = 1.0
FRAME_S = 0.1  # between two pictures of the screen while something happens
REST_S = 0.5  # and while nothing does
STATUS_S = 2.0  # between two looks at what no event tells
AGAIN_S = 0.5  # between two tries to find a daemon


@command("watch")
@click.option("--lines", is_flag=True, help="Lines on a terminal, too.")
@click.option("--all", "every", is_flag=True, help="Lines, also of telemetry and heartbeats.")
@click.option("--count", type=click.IntRange(min=1), help="Lines; end after so many events.")
def watch(context: Context, lines: bool, every: bool, count: int | None) -> None:
    """Show the cell live until Ctrl-C: state, arm, contacts, progress, last events, fault.

    The screen outlives the daemon and finds it again. In a pipe, and with --json, each event is
    one line.
    """
    out = context.output
    with connected(context, events=True) as client:
        client.call("ping")
        try:
            plain = lines or every or count or out.as_json
            if out.terminal and sys.stdout.isatty() and not plain:
                full_screen(client, endpoint(context), out.people)
            else:
                each_line(context, client, every, count)
        except KeyboardInterrupt:
            return


def each_line(context: Context, client: "Client", every: bool, count: int | None) -> None:
    """Print events as they come, for people with when they were heard and the cell's clock."""
    from legato.cli.live import STALE_S

    out, seen, heard, silent = context.output, 0, time.monotonic(), False
    if not out.as_json:
        out.note("heard at, the cell's clock in s, topic, what happened; the first may be older")
    while True:
        for topic, event in client.events(LISTEN_S):
            heard = time.monotonic()
            if silent:
                silent = tell_link(out, "live", "the daemon is heard again")
            if topic in QUIET and not every:
                continue
            out.line({"topic": topic, **event})
            if not out.as_json:
                told = f"{event.get('t', 0):12.3f} {topic:<9} {line_of(topic, event)}"
                out.say(f"{time.strftime('%H:%M:%S')} {told}")
            seen += 1
            if seen == count:
                return
        quiet = time.monotonic() - heard
        if quiet > STALE_S and not silent:
            silent = tell_link(out, "stale", f"nothing heard of the daemon for {quiet:.0f} s")


def tell_link(out: "Output", link: str, text: str) -> bool:
    """Say a line of the link itself, which no daemon tells; True where the daemon is silent."""
    out.line({"topic": "link", "link": link, "text": text})
    if not out.as_json:
        out.say(f"{time.strftime('%H:%M:%S')} {'':>12} {'link':<9} {text}")
    return link != "live"


def endpoint(context: Context) -> str:
    """Return where the daemon is looked for."""
    from legato.config.load import load_server

    return str(load_server(context.config).requests)


def full_screen(
    client: "Client", where: str, console: "Console", listen: "Listen | None" = None
) -> None:
    """Show the screen until Ctrl-C, whatever becomes of the daemon."""
    from rich.live import Live as Display

    from legato.cli.live import Live
    from legato.cli.screen import screen

    live = Live(where)
    with Display(console=console, screen=True, auto_refresh=False) as display:

        def draw() -> None:
            display.update(screen(live, time.monotonic(), *console.size), refresh=True)

        while True:
            ask(client, live)
            draw()
            (listen or hear)(client, live, draw)


def ask(client: "Client", live: "Live") -> None:
    """Ask for the status, and for the table of states where the daemon is another one."""
    from legato.daemon.client import DaemonUnavailable, RpcError

    try:
        status = client.call("status")
        if not live.states or status.get("boot") != live.boot:
            live.states = tuple(client.call("describe")["states"])
        live.answered(status, time.monotonic())
    except (DaemonUnavailable, RpcError):
        live.lose(time.monotonic())


def hear(client: "Client", live: "Live", draw: Callable[[], None]) -> None:
    """Take events for a while and draw them as they come."""
    until = time.monotonic() + (AGAIN_S if live.lost_at is not None else STATUS_S)
    drawn, fresh = time.monotonic(), False
    while (now := time.monotonic()) < until:
        for topic, event in client.events(FRAME_S):
            now, fresh = time.monotonic(), True
            live.take(topic, event, now)
            if topic == "state" and event.get("state") == "fault":
                until = now  # the status tells the hint at once
            if now - drawn >= FRAME_S:
                draw()
                drawn, fresh = now, False
            if now >= until:
                break
        if fresh or time.monotonic() - drawn >= REST_S:
            draw()
            drawn, fresh = time.monotonic(), False
