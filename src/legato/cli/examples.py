"""Examples for every command's `--help`: the line, and what it is for."""

from collections.abc import Mapping

import click

Example = tuple[str, str]

EXAMPLES: Mapping[str, tuple[Example, ...]] = {
    "demo": (
        ("legato demo", "the whole job on the simulated cell"),
        ("legato demo --seed 7 --out /tmp/demo", "another leg pose, records elsewhere"),
    ),
    "serve": (
        ("legato serve", "the simulated cell"),
        ("legato serve --config cell.toml", "a real one"),
    ),
    "status": (
        ("legato status", "what the cell does now"),
        ("legato status --json | jq .state", "for a script"),
    ),
    "run": (
        ("legato run", "follow the whole job to its end"),
        ("legato run --no-wait --key morning", "start it once, however often this is sent"),
    ),
    "capture": (("legato capture", "take a picture"),),
    "calibrate": (
        ("legato calibrate", "find the leg in it"),
        ("legato calibrate --picks picks.json", "near the marks that a person has named in it"),
    ),
    "verify": (("legato verify --json", "may the calibration be used?"),),
    "home": (("legato home", "park the arm"),),
    "massage": (("legato massage", "press with the calibration that was verified"),),
    "campaign": (
        ("legato campaign --count 10", "ten runs, one after the other"),
        ("legato campaign --every 1800 --until 06:30 --resets 2", "through the night"),
    ),
    "pause": (("legato pause", "hold at the next safe point"),),
    "resume": (("legato resume", "go on"),),
    "stop": (("legato stop", "retract and end the job"),),
    "estop": (("legato estop", "no further motion; then look at the arm"),),
    "reset": (("legato reset", "leave fault"),),
    "shutdown": (("legato shutdown", "end the daemon"),),
    "reference": (
        ("legato reference", "the arm stands at robot.start"),
        ("legato reference --xyz 127 0 150", "it stands elsewhere: mm in the robot's frame"),
    ),
    "lease": (
        ("legato lease legato run", "a job that nobody else can interfere with, but for a stop"),
        ("legato lease --deadman sh night.sh", "a script; should it die, the arm is paused"),
    ),
    "watch": (
        ("legato watch", "a live screen"),
        ("legato watch --lines", "an event a line"),
        ("legato watch --json --all | jq .", "for a script, telemetry too"),
    ),
    "web": (
        ("legato web", "a page that may act, for whoever has its address"),
        ("legato web --observe --port 8080", "a page that only looks on"),
    ),
    "sessions": (
        ("legato sessions", "the latest"),
        ("legato sessions 20261122T050151Z-1005", "one of them"),
        ("legato sessions verify", "is any record changed?"),
    ),
    "sessions show": (("legato sessions 20261122T050151Z-1005 --json", "one, for a script"),),
    "sessions verify": (("legato sessions verify", "hold every record to its hashes"),),
    "sessions replay": (("legato sessions replay", "decide the latest session again"),),
    "campaigns": (("legato campaigns", "the latest"),),
    "report": (
        ("legato report", "of the latest session"),
        ("legato report 20261122T050151Z-1005 --pdf -o report.pdf", "of one, for paper"),
    ),
    "compare": (
        ("legato compare --last 10 --job run", "how well the last ten repeat"),
        ("legato compare A B -o ab.html", "two sessions by their ids"),
    ),
    "export": (
        ("legato export -o session.mcap", "the latest session, for Foxglove or Rerun"),
        ("legato export A --format csv -o tables", "tables for a notebook"),
        ("legato export --format urdf -o arm.urdf", "the configured arm"),
    ),
    "detect": (("legato detect picture.png --json", "the marks, and those missing"),),
    "solve": (
        ("legato solve picture.png", "camera and leg from one picture"),
        ("legato solve picture.png --engine paper --json", "by the paper's search"),
    ),
    "intrinsics": (
        ("legato intrinsics views/*.png --out intrinsics.toml", "calibrate the camera"),
    ),
    "snapshot": (("legato snapshot --views 20 --out views", "pictures to calibrate with"),),
    "emulate": (("legato emulate", "an arm on a pseudo-terminal"),),
    "keygen": (("legato keygen --help", "which keys a cell needs"),),
    "check": (
        ("legato check --config cell.toml", "what stands in the way, and what to do"),
        ("legato check --json | jq '.checks[] | select(.ok == false)'", "for a script"),
    ),
    "completion": (
        ("legato completion bash > ~/.local/share/bash-completion/completions/legato", "bash"),
        ('legato completion zsh > "${fpath[1]}/_legato"', "zsh"),
        ("legato completion fish > ~/.config/fish/completions/legato.fish", "fish"),
    ),
}


def write_examples(ctx: click.Context, formatter: click.HelpFormatter) -> None:
    """Write the examples of a context's command, where it has any, as a section of its help."""
    found = EXAMPLES.get(" ".join(_names(ctx)), ())
    if not found:
        return
    with formatter.section("Examples"):
        for line, what in found:
            formatter.write(f"{'':>{formatter.current_indent}}{line}\n")
            formatter.write(f"{'':>{formatter.current_indent}}    {what}\n")


def _names(ctx: click.Context) -> list[str]:
    """Return the command's own names, whatever the program was called by."""
    if ctx.parent is None:
        return []
    return [*_names(ctx.parent), str(ctx.info_name)]
