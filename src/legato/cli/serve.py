"""`legato serve`: the daemon in the foreground."""

from legato.cli.command import Context, command
from legato.cli.exits import Exit


@command("serve")
def serve(context: Context) -> None:
    """Run the daemon until it is told to shut down or gets SIGTERM.

    It logs to stderr: JSON lines where that is no terminal, `ready` with its addresses first.
    """
    from legato.config.load import load
    from legato.daemon.serve import serve as run

    code = run(load(context.config))
    if code:
        context.end(Exit(code))
