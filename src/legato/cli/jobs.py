"""`legato run capture calibrate verify home massage`: start a job and follow it to its end."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit, exit_of
from legato.cli.follow import follow
from legato.cli.line import connected
from legato.cli.picture import picks_option, read_picks

if TYPE_CHECKING:
    from legato.daemon.client import Client

JOBS = {
    "run": "Find the leg, verify, go home, massage every station, go home.",
    "capture": "Take a picture.",
    "calibrate": "Find the leg in the picture that was taken, or in a new one.",
    "verify": "Decide whether the calibration may be used.",
    "home": "Go to the parked pose.",
    "massage": "Massage every station with the verified calibration.",
}
PICKING = ("run", "calibrate")  # what finds the leg, and so can be told where its marks are
TAIL = "\n\nShows progress until the job ends; Ctrl-C asks for a stop, a second one leaves."


def job_command(name: str, help_text: str) -> click.Command:
    """Return the command that starts one job."""

    @command(name, help=help_text + TAIL)
    @click.option("--no-wait", is_flag=True, help="Return once the job has started.")
    @click.option("--key", help="The same key again gives the same session and starts nothing.")
    def job(context: Context, no_wait: bool, key: str | None, picks: Path | None = None) -> None:
        params: dict[str, Any] = {} if key is None else {"key": key}
        if picks is not None:
            params["picks"] = read_picks(picks)
        with connected(context, events=not no_wait) as client:
            start(context, client, name, no_wait, params)

    return picks_option(job) if name in PICKING else job


def start(
    context: Context, client: "Client", name: str, no_wait: bool, params: Mapping[str, Any]
) -> None:
    """Start a job, follow it unless told not to, and end with its outcome's code."""
    out = context.output
    begun = client.call(name, **params)
    session = str(begun["session"])
    if no_wait:
        out.document(begun)
        out.say(f"{name} has begun: session {session}")
        return
    out.note(f"{name}: session {session}")
    answer = follow(client, session, out)
    out.document(answer)
    reason = f": {answer['reason']}" if answer.get("reason") else ""
    out.say(f"{name}: {answer['outcome']}{reason}")
    if answer["outcome"] == "refused":
        out.say(f"  what to do: `legato report {session}` tells it for each test that failed")
    code = exit_of(answer["outcome"])
    if code != Exit.DONE:
        context.end(code)


COMMANDS = tuple(job_command(name, text) for name, text in JOBS.items())
