"""`legato serve`: the daemon in the foreground."""

import os

from legato.cli.command import Context, command
from legato.cli.exits import Exit


@command("serve")
def serve(context: Context) -> None:
    """Run the daemon until it is told to shut down or gets SIGTERM.

    It logs to stderr: JSON lines where that is no terminal, `ready` with its addresses first.
    """
    # Before numpy is loaded: its threads would cost start and memory, and nothing here needs them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from legato.config.place import state_dir_in
    from legato.daemon.lock import AlreadyRunning, look
    from legato.daemon.log import make_log

    log = make_log()
    place = state_dir_in(context.config) if context.config is not None else None
    try:
        if place is not None:
            look(place)
    except AlreadyRunning as error:
        log.error("already_running", text=str(error), hint="stop it first")
        context.end(Exit.FAILED)
    from legato.config.load import load
    from legato.daemon.serve import serve as run

    code = run(load(context.config), log)
    if code:
        context.end(Exit(code))
