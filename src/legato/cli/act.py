"""`legato pause resume stop estop reset reference shutdown`: one request, one answer.

Stop and estop go the stop line, and wait until the driver has confirmed them.
"""

import time
from typing import TYPE_CHECKING, Any

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit
from legato.cli.line import connected

if TYPE_CHECKING:
    from legato.daemon.client import Client

REQUESTS = {
    "pause": "Retract at the next safe point and hold.",
    "resume": "Go on with the stroke that was broken off.",
    "reset": "Leave fault once arm and camera answer.",
    "shutdown": "Stop what runs, let go of the devices, end the daemon.",
}
STOPS = {
    "stop": "Finish the current short motion, retract, end the job as stopped.",
    "estop": "Send the arm no further motion; fault. Never refused. No replacement for a "
    "hardware stop.",
}
CONFIRM_S = 10.0  # how long a stop that is not confirmed at once is followed
LOOK_S = 0.1


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


def stop_command(name: str, help_text: str) -> click.Command:
    """Return the command that stops by the stop line; exit 1 where the arm confirms nothing."""

    @command(name, help=help_text)
    def stop(context: Context) -> None:
        with connected(context, line="stop") as client:
            answer = client.call(name)
            if answer.get("confirmed", 0.0) is None:
                context.output.note(f"{name} given, not confirmed yet: {answer.get('reason')}")
                answer = confirmed(client, answer)
        context.output.document(answer)
        if answer.get("confirmed", 0.0) is None:
            text = f"{name} given, but NOT confirmed: {answer.get('reason')}; look at the arm"
            context.output.say(text)
            context.end(Exit.FAILED)
        context.output.say(f"{name} confirmed: state {answer['state']}")

    return stop


def confirmed(client: "Client", answer: dict[str, Any]) -> dict[str, Any]:
    """Return the answer to a stop as it stands when it is confirmed, or when the time is up."""
    until = time.monotonic() + CONFIRM_S
    while time.monotonic() < until:
        last = client.call("ping").get("last") or {}
        if last.get("received") != answer["received"]:
            return answer
        if last.get("confirmed") is not None:
            return dict(last)
        time.sleep(LOOK_S)
    return answer


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


COMMANDS = (
    *(request_command(name, text) for name, text in REQUESTS.items()),
    *(stop_command(name, text) for name, text in STOPS.items()),
    reference,
)
