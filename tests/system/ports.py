"""The ports that a newcomer gets: tests that use them take turns, whichever process runs them."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from fcntl import LOCK_EX, flock
from pathlib import Path


@contextmanager
def default_ports() -> Iterator[None]:
    """Keep the default ports to oneself."""
    with (Path(tempfile.gettempdir()) / f"legato-ports-{os.getuid()}").open("w") as file:
        flock(file, LOCK_EX)
        yield
