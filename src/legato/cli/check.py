"""`legato check`: what stands in the way of a session, each with what to do."""

from datetime import UTC, datetime

from legato.cli.command import Context, command
from legato.cli.doctor import Finding, examine
from legato.cli.exits import Exit
from legato.cli.surroundings import around

MARKS = {True: "ok", False: "NO", None: "look"}
STYLES = {"ok": "green", "NO": "bold red", "look": "yellow"}


@command("check")
def check(context: Context) -> None:
    """Look at all that a session needs, and say what to do where something is wrong.

    Configuration, keys, daemon, clock, intrinsics, reach, devices, disk. Nothing is moved; the
    camera is asked for a picture where no daemon has it.
    """
    from legato.config.load import load

    loaded, now = load(context.config, need_intrinsics=False), datetime.now(UTC)
    findings = [*examine(loaded, now), *around(context, loaded, now)]
    show(context, findings)
    document = [{"name": f.name, "ok": f.ok, "text": f.text, "hint": f.hint} for f in findings]
    wrong = [f.name for f in findings if f.ok is False]
    context.output.document({"ok": not wrong, "checks": document})
    if wrong:
        context.end(Exit.USAGE if "intrinsics" in wrong else Exit.FAILED)


def show(context: Context, findings: list[Finding]) -> None:
    """Show each finding to a person, what to do right under it, and a verdict."""
    rows = []
    for finding in findings:
        rows.append((MARKS[finding.ok], finding.name, finding.text))
        if finding.ok is not True and finding.hint:
            rows.append(("", "", f"what to do: {finding.hint}"))
    context.output.table(("", "", ""), rows, styles=STYLES)
    wrong = sum(f.ok is False for f in findings)
    look = sum(f.ok is None for f in findings)
    verdict = f"{wrong} to be put right" if wrong else "nothing stands in the way"
    context.output.say(f"{verdict}, {look} worth a look" if look else verdict)
