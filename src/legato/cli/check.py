"""`legato check`: what stands in the way of a session, each with what to do."""

from datetime import UTC, datetime

from legato.cli.command import Context, command
from legato.cli.doctor import Finding, examine
from legato.cli.exits import Exit

MARKS = {True: "ok", False: "NO", None: "look"}


@command("check")
def check(context: Context) -> None:
    """Look at configuration, intrinsics, reach, devices and disk; nothing is opened or moved."""
    from legato.config.load import load

    loaded = load(context.config, need_intrinsics=False)
    findings = list(examine(loaded, datetime.now(UTC)))
    show(context, findings)
    document = [{"name": f.name, "ok": f.ok, "text": f.text, "hint": f.hint} for f in findings]
    wrong = [f.name for f in findings if f.ok is False]
    context.output.document({"ok": not wrong, "checks": document})
    if wrong:
        context.end(Exit.USAGE if "intrinsics" in wrong else Exit.FAILED)


def show(context: Context, findings: list[Finding]) -> None:
    """Show each finding to a person, and what to do where something is to be done."""
    context.output.table(("", "", ""), [(MARKS[f.ok], f.name, f.text) for f in findings])
    for finding in findings:
        if finding.ok is not True and finding.hint:
            context.output.say(f"{finding.name}: what to do: {finding.hint}")
