"""The console script: nothing is imported before a Ctrl-C can be met in one line."""

import sys
from collections.abc import Callable, Sequence


def load() -> Callable[[], object]:
    """Return the command line, imported."""
    from legato.cli.main import main

    return main


def run(
    load: Callable[[], Callable[[], object]] = load, arguments: Sequence[str] | None = None
) -> None:
    """Run the command line; a Ctrl-C at any moment ends it with 1 and one line.

    `arguments`, by default the process's own, say whether stdout is to hold a JSON document.
    """
    try:
        load()()
    except KeyboardInterrupt:
        sys.stderr.write("legato: interrupted\n")
        if "--json" in (sys.argv if arguments is None else arguments):
            sys.stdout.write('{"error": {"text": "interrupted", "hint": "", "exit": 1}}\n')
        sys.exit(1)
