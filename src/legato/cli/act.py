"""`legato pause resume stop estop reset reference shutdown`: one request, one answer."""

from typing import Any

import click

from legato.cli.command import Context, command
from legato.cli.line import connected

REQUESTS = {
    "pause": "Retract at the next safe point and hold.",
    "resume": "Go on with the stroke that was broken off.",
    "stop": "Finish the current short motion, retract, end the job as stopped.",
    "estop": "Send the arm no further motion; fault. Never refused. No replacement for a "
    "hardware stop.",
    "reset": "Leave fault once arm and camera answer.",
    "shutdown": "Stop what runs, let go of the devices, end the daemon.",
}


def ask(context: Context, method: str, **params: Any) -> None:
    """Send one request and show its answer."""
    with connected(context) as client:
        answer = client.call(method, **params)
    context.output.document(answer)
    state = f": state {answer['state']}" if isinstance(answer, dict) and "state" in answer else ""
    context.output.say(f"{method} accepted{state}")


def request_command(name: str, help_text: str) -> click.Command:
    """Return the command that sends one request without parameters."""

    @command(name, help=help_text)
    def request(context: Context) -> None:
        ask(context, name)

    return request


@command("reference")
@click.option("--xyz", nargs=3, type=float, metavar="X Y Z", help="Fingertip's place, mm.")
@click.option("--pitch", type=float, help="Pitch of the hand, deg.")
@click.option("--roll", type=float, help="Roll of the hand, deg.")
def reference(
    context: Context,
    xyz: tuple[float, float, float] | None,
    pitch: float | None,
    roll: float | None,
) -> None:
    """Say at which pose the arm stands now, by default robot.start.

    Registers are zeroed there. Nothing moves, but motor current may drop.
    """
    given = {"xyz_mm": list(xyz) if xyz else None, "pitch_deg": pitch, "roll_deg": roll}
    ask(context, "reference", **{k: v for k, v in given.items() if v is not None})


COMMANDS = (*(request_command(name, text) for name, text in REQUESTS.items()), reference)
