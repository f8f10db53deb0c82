"""One daemon for one state folder: a lock that ends with the process that holds it."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


class AlreadyRunning(Exception):
    """Another process holds the lock."""


@contextmanager
def only_instance(state_dir: Path) -> Iterator[None]:
    """Hold `state_dir`/lock; raises AlreadyRunning naming who holds it, OSError."""
    state_dir.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(state_dir / "lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        _lock(descriptor, fcntl.LOCK_EX, state_dir)
        with suppress(OSError):  # a full disk: then a second daemon is not told who is the first
            os.ftruncate(descriptor, 0)
            os.write(descriptor, f"{os.getpid()}\n".encode())
        yield
    finally:
        os.close(descriptor)


def look(state_dir: Path) -> None:
    """Raise AlreadyRunning where another holds `state_dir`/lock; nothing is held afterwards.

    A daemon that is not the first learns of it so before it has loaded its libraries.
    """
    try:
        descriptor = os.open(state_dir / "lock", os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return  # there is none yet, or whoever takes it will say why it cannot be had
    try:
        _lock(descriptor, fcntl.LOCK_SH, state_dir)
    finally:
        os.close(descriptor)


def _lock(descriptor: int, kind: int, state_dir: Path) -> None:
    try:
        fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.read(descriptor, 32).decode("ascii", "replace").strip() or "unknown"
        text = f"another legato daemon (process {holder}) uses {state_dir}"
        raise AlreadyRunning(text) from None
