"""The console script: nothing is imported before a Ctrl-C can be met in one line."""

import os
import sys
from collections.abc import Callable, Sequence


def load() -> Callable[[], object]:
    """Return the command line, imported."""
    from legato.cli.main import main

    return main


def whole_streams() -> None:
    """Give the process the standard streams that it was begun without.

    Else a lock or a socket would get their numbers, and what is written there would go into it.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = sys.stdout or os.fdopen(1, "w", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", closefd=False)


def run(
    load: Callable[[], Callable[[], object]] = load, arguments: Sequence[str] | None = None
) -> None:
    """Run the command line; a Ctrl-C at any moment ends it with 1 and one line.

    `arguments`, by default the process's own, say whether stdout is to hold a JSON document.
    """
    whole_streams()
    try:
        load()()
    except KeyboardInterrupt:
        sys.stderr.write("legato: interrupted\n")
        if "--json" in (sys.argv if arguments is None else arguments):
            sys.stdout.write('{"error": {"text": "interrupted", "hint": "", "exit": 1}}\n')
        sys.exit(1)
