"""`legato lease`: the cell for one program alone, as long as it runs."""

import os
import subprocess
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from legato.cli.command import Context, command
from legato.cli.exits import Exit, Failure
from legato.cli.line import LEASE, connected

if TYPE_CHECKING:
    from legato.daemon.client import Client

SIGNALLED = 128  # a shell's code for a command that a signal has ended, less the signal's number
RENEWALS = 3.0  # a lease is renewed so often before it would end


@command("lease", context_settings={"allow_interspersed_args": False})
@click.option("--deadman", is_flag=True, help="Where this command dies, the arm is paused.")
@click.option("--seconds", type=click.FloatRange(1.0, 60.0), default=10.0, show_default=True,
              help="How long the lease outlives this command's death.")  # fmt: skip
@click.argument("words", metavar="[COMMAND]...", nargs=-1, type=click.UNPROCESSED)
def lease(context: Context, deadman: bool, seconds: float, words: tuple[str, ...]) -> None:
    """Keep the cell for COMMAND while it runs: others may read and stop, nothing else.

    COMMAND has the lease's token in LEGATO_LEASE: what `legato` is asked for in it is asked for
    under the lease. This one ends with COMMAND's exit code, but with 1 where the lease was lost and
    COMMAND ended with 0, and with 2 where COMMAND cannot be run. Without COMMAND the lease is kept
    until Ctrl-C.
    """
    with connected(context) as client:
        held = _Held(client, seconds, deadman=deadman)
        try:
            code = _while_held(context, held, words)
        finally:
            held.give_back()
    if code:
        raise click.exceptions.Exit(code)


class _Held:
    """A lease that has been taken."""

    def __init__(self, client: "Client", seconds: float, *, deadman: bool) -> None:
        self._client = client
        self._asked: dict[str, Any] = {"duration_s": seconds, "deadman": deadman}
        self.every_s = seconds / RENEWALS
        self.token: str | None = str(client.call("lease", **self._asked)["lease"])

    def renew(self) -> str | None:
        """Renew the lease; return why it is lost, if it is."""
        from legato.daemon.client import DaemonUnavailable, RpcError

        try:
            self._client.call("lease", lease=self.token, **self._asked)
        except (RpcError, DaemonUnavailable) as error:
            self.token = None
            return str(error)
        return None

    def give_back(self) -> None:
        """End the lease, unless it is lost."""
        if self.token is not None:
            self._client.call("lease", lease=self.token, duration_s=0.0)


def _while_held(context: Context, held: _Held, words: tuple[str, ...]) -> int:
    """Run a command, or wait for Ctrl-C, and renew the lease meanwhile; return the exit code."""
    if words:
        with _begun(words, held) as child:
            lost = _kept(context, held, lambda seconds: _ended(child, seconds))
            code = child.wait() or lost
            return code if code >= 0 else SIGNALLED - code
    context.output.document({"lease": held.token})
    context.output.say(f"{LEASE}={held.token}")
    context.output.note("kept until Ctrl-C")
    return _kept(context, held, _interrupted)


def _begun(words: tuple[str, ...], held: _Held) -> "subprocess.Popen[bytes]":
    try:
        return subprocess.Popen(words, env=os.environ | {LEASE: str(held.token)})
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        hint = "give a program as you would to the shell, with its arguments"
        raise Failure(f"cannot run {words[0]!r}: {reason}", Exit.USAGE, hint) from error


def _kept(context: Context, held: _Held, ended: Callable[[float], int | None]) -> int:
    """Renew until `ended`, asked to wait so many seconds, gives a code; return it."""
    while (code := ended(held.every_s)) is None:
        lost = held.renew()
        if lost is not None:
            context.output.note(f"the lease is lost: {lost}")
            return Exit.FAILED
    return code


def _ended(child: "subprocess.Popen[bytes]", seconds: float) -> int | None:
    """Return a command's exit code; a Ctrl-C has reached it too, and it ends as it sees fit."""
    try:
        return child.wait(seconds)
    except (subprocess.TimeoutExpired, KeyboardInterrupt):
        return child.poll()


def _interrupted(seconds: float) -> int | None:
    """Return 0 where Ctrl-C comes."""
    try:
        time.sleep(seconds)
    except KeyboardInterrupt:
        return Exit.DONE
    return None
