"""A symbolic link that follows a port wherever the kernel puts it, kept by one process alone."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from legato.cli.exits import Exit, Failure


def check_link(link: Path) -> None:
    """Raise Failure where a link cannot be put because something else is in its place."""
    if link.exists() and not link.is_symlink():
        raise Failure(f"{link} exists and is no link", Exit.USAGE, "name another --link")


@contextmanager
def kept(link: Path | None) -> Iterator[None]:
    """Keep a link for this process alone; raises Failure where another emulator keeps it.

    The lock is a file beside it, and ends with its process.
    """
    if link is None:
        yield
        return
    lock = link.with_name(f".{link.name}.lock")
    with lock.open("w") as held:
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            text = f"another emulator keeps the link {link}"
            raise Failure(text, Exit.USAGE, "end it, or name another --link") from None
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)


def relink(link: Path, path: str) -> None:
    """Point a symbolic link at a path."""
    fresh = link.with_name(f".{link.name}.{os.getpid()}")
    fresh.symlink_to(path)
    fresh.replace(link)
