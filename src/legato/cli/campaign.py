"""`legato campaign campaigns`: repeat a job unattended, and see what has come of it."""

import re
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from legato.cli.chosen import quiet
from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure, exit_of
from legato.cli.follow import LISTEN_S, Interrupts, ask_stop, interrupts
from legato.cli.jobs import JOBS
from legato.cli.line import connected
from legato.cli.output import Output
from legato.cli.store import state_dir_option
from legato.report.lines import line_of

if TYPE_CHECKING:
    from legato.daemon.client import Client

CLOCK = re.compile(r"(\d{1,2}):(\d{2})")
SHOWN = ("campaign", "fault")
COMPLETED = 100  # the latest so many


@command("campaign")
@click.option("--job", type=click.Choice([*JOBS]), default="run", show_default=True)
@click.option("--count", type=click.IntRange(min=1), help="End after so many repetitions.")
@click.option("--every", "every_s", type=float, help="Seconds from one start to the next.")
@click.option("--for", "for_s", type=float, help="End after so many seconds of the cell.")
@click.option("--until", help="End at a time: 06:30, or 2026-03-02T06:30 with or without a zone.")
@click.option("--resets", type=int, help="Leave a fault of the camera so many times. Default 0.")
@click.option("--key", help="The same key again gives the same campaign and starts nothing.")
@click.option("--end", is_flag=True, help="Let the repetition under way be the last, and leave.")
@click.option("--no-wait", is_flag=True, help="Return once the campaign has begun.")
def campaign(context: Context, end: bool, no_wait: bool, until: str | None, **asked: Any) -> None:
    """Repeat a job until a count, a span or a time of day, and show its summary.

    Only a fault of the camera may be left by itself; any other ends the campaign. Ctrl-C asks for
    a stop, a second one leaves; `legato stop` ends it too.
    """
    out = context.output
    given = {name: value for name, value in asked.items() if value is not None}
    if until is not None:
        given["until"] = moment(until, datetime.now().astimezone())
    with connected(context, events=not (no_wait or end)) as client:
        if end:
            told = client.call("end_campaign")
            out.document(told)
            out.say(f"campaign {told['id']} ends with the repetition under way")
            return
        begun = client.call("campaign", **given)
        name = str(begun["campaign"])
        if no_wait:
            out.document(begun)
            out.say(f"campaign {name} has begun: session {begun['session']}")
            return
        out.note(f"campaign {name} of {asked['job']}")
        summary = follow(client, name, out)
    out.document(summary)
    show(out, summary)
    failed = Exit.FAILED if summary.get("failed") else Exit.DONE
    code = exit_of(summary["outcome"])
    if (code or failed) != Exit.DONE:
        context.end(code or failed)


def completed(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
    """Return the campaigns that begin so, newest first, for a shell."""
    from legato.cli.store import opened_store
    from legato.daemon.campaign_files import CampaignFiles

    del param
    with suppress(Exception):  # a shell waits for words, and shows no error
        store = opened_store(quiet(ctx), ctx.params.get("state_dir"))
        heads = CampaignFiles(store.state_dir).heads(COMPLETED)
        return [str(h["id"]) for h in heads if str(h["id"]).startswith(incomplete)]
    return []


@command("campaigns")
@click.argument("campaign", required=False, shell_complete=completed)
@state_dir_option
@click.option("--limit", type=click.IntRange(min=1), default=20, show_default=True)
def campaigns(context: Context, campaign: str | None, state_dir: Path | None, limit: int) -> None:
    """List the latest campaigns, newest first, or show the summary of one CAMPAIGN.

    They are read from the disk; no daemon is needed.
    """
    from legato.cli.store import opened_store
    from legato.daemon.campaign_files import CampaignFiles

    out = context.output
    files = CampaignFiles(opened_store(context, state_dir).state_dir)
    if campaign is not None:
        found = files.read(campaign)
        if found is None:
            raise Failure(f"there is no campaign {campaign}", hint="`legato campaigns` lists them")
        out.document(found)
        show(out, found)
        return
    heads = files.heads(limit)
    out.document(heads)
    rows = [
        (h["id"], h["job"], h.get("outcome") or "open", h["done"], h["failed"], h["reason"] or "")
        for h in heads
    ]
    if rows:
        out.table(("campaign", "job", "outcome", "done", "failed", "reason"), rows)
    else:
        out.say(f"no campaigns in {files.folder}")


def follow(client: "Client", name: str, out: Output) -> dict[str, Any]:
    """Show a campaign until it has ended; return its summary."""
    stopping = False
    with interrupts() as heard:
        while True:
            if heard.asked and not stopping:
                stopping = True
                out.note("stopping: the arm finishes its short motion and retracts")
                ask_stop(client, out)
            _listen(client, name, out, heard, stopping=stopping)
            told = client.call("status").get("campaign") or {}
            if told.get("id") != name or told.get("ended") is not None:
                _listen(client, name, out, heard, stopping=True)  # what is still on its way
                return dict(client.call("campaigns", campaign=name))


def _listen(client: "Client", name: str, out: Output, heard: Interrupts, *, stopping: bool) -> None:
    """Show what happens until nothing does for a moment."""
    for topic, event in client.events(LISTEN_S):
        # A new subscriber is first sent the last of each topic, also of earlier campaigns.
        if topic in SHOWN and event.get("id", name) == name:
            out.note(f"{topic:<8} {line_of(topic, event)}")
        if topic == "heartbeat" or (heard.asked and not stopping):
            return


def moment(text: str, now: datetime) -> str:
    """Return a time to come as ISO text with its zone; a time of day is the next one."""
    if match := CLOCK.fullmatch(text):
        try:
            then = now.replace(
                hour=int(match[1]), minute=int(match[2]), second=0, microsecond=0, fold=0
            )
        except ValueError as error:
            raise Failure(f"--until {text}: {error}", Exit.USAGE) from error
        return (then if then > now else then + timedelta(days=1)).isoformat()
    try:
        given = datetime.fromisoformat(text)
    except ValueError as error:
        raise Failure(f"--until {text}: {error}", Exit.USAGE, "such as 06:30") from error
    return (given if given.tzinfo else given.astimezone()).isoformat()


def show(out: Output, summary: Mapping[str, Any]) -> None:
    """Show a summary to a person."""
    of = f" of {summary['total']}" if summary.get("total") else ""
    reason = f": {summary['reason']}" if summary.get("reason") else ""
    out.say(f"campaign {summary['id']} {summary.get('outcome') or 'under way'}{reason}")
    resets = len(summary.get("resets_done") or ())
    out.say(f"{summary['job']}: {summary['done']}{of} done, {summary['failed']} failed, "
            f"resets by itself: {resets}")  # fmt: skip
    rows = [
        (row["id"], row["outcome"], row.get("reason") or "")
        for row in summary.get("sessions") or ()
        if row["outcome"] != "done"
    ]
    if rows:
        out.table(("session", "outcome", "reason"), rows)
    names = ("count", "mean_mm", "sigma_mm", "least_mm", "most_mm")
    contacts = [
        (f"{float(station):g}", *(told.get(name) for name in names))
        for station, told in (summary.get("contacts") or {}).items()
    ]
    if contacts:
        out.table(("station_mm", *names), contacts)
