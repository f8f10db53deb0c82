"""`legato`: puts the commands together; each stands in a file of its own."""

import click

from legato import __version__
from legato.cli import act, jobs
from legato.cli.campaign import campaign, campaigns
from legato.cli.check import check
from legato.cli.compare import compare
from legato.cli.completion import completion
from legato.cli.demo import demo
from legato.cli.detect import detect
from legato.cli.emulate import emulate
from legato.cli.exits import EPILOG
from legato.cli.export import export
from legato.cli.intrinsics import intrinsics
from legato.cli.keygen import keygen
from legato.cli.lease import lease
from legato.cli.report import report
from legato.cli.serve import serve
from legato.cli.sessions import sessions
from legato.cli.snapshot import snapshot
from legato.cli.solve import solve
from legato.cli.status import status
from legato.cli.watch import watch
from legato.cli.web import web


class InOrder(click.Group):
    """A group that lists its commands in the order in which they were added."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the commands' names."""
        del ctx
        return list(self.commands)


@click.group(cls=InOrder, epilog=EPILOG)
@click.version_option(__version__, prog_name="legato")
def main() -> None:
    """Control a leg-massage robot cell: one camera, a TeachMover arm, run unattended.

    A stepper arm without encoders needs a hardware stop; the software is none.
    """


for item in (
    demo, serve, status, *jobs.COMMANDS, campaign, *act.COMMANDS, lease, watch, web, sessions,
    campaigns, report, compare, export, detect, solve, intrinsics, snapshot, emulate, keygen,
    check, completion,
):  # fmt: skip
    main.add_command(item)
