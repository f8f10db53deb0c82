"""`python -m legato.cli.leash ...` is the console script, ended by the kernel with its parent."""

import ctypes
import os
import signal
import sys

from legato.cli.main import main

PR_SET_PDEATHSIG = 1  # prctl(2)


def tie(parent: int) -> None:
    """Have this process sent SIGTERM when `parent` ends; exit where it already has."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        sys.exit("legato: the process that started this one has ended")


if __name__ == "__main__":
    tie(int(os.environ["LEGATO_PARENT"]))
    main(prog_name="legato")
