"""`legato watch`: the daemon's events, one a line."""

import click

from legato.cli.command import Context, command
from legato.cli.events import line_of
from legato.cli.line import connected

QUIET = ("telemetry", "heartbeat")
LISTEN_S = 1.0


@command("watch")
@click.option("--all", "every", is_flag=True, help="Also telemetry and heartbeats.")
@click.option("--count", type=click.IntRange(min=1), help="End after so many events.")
def watch(context: Context, every: bool, count: int | None) -> None:
    """Print events as they come, until Ctrl-C; with --json one JSON document a line."""
    out, seen = context.output, 0
    with connected(context, events=True) as client:
        client.call("ping")
        try:
            while True:
                for topic, event in client.events(LISTEN_S):
                    if topic in QUIET and not every:
                        continue
                    out.line({"topic": topic, **event})
                    if not out.as_json:
                        out.say(f"{event.get('t', 0):12.3f} {topic:<9} {line_of(topic, event)}")
                    seen += 1
                    if seen == count:
                        return
        except KeyboardInterrupt:
            return
