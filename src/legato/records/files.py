"""Files that survive a crash: replaced as a whole, or only ever appended to.

No symbolic link is followed. Every OSError comes out as a RecordError.
"""

import hashlib
import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from legato.records.errors import RecordError, told

FILE_MODE, FOLDER_MODE = 0o640, 0o750
# What msgspec raises for bytes that are no JSON: its own, and Python's for UTF-8 and for depth.
NO_JSON = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
NO_LINK = os.O_NOFOLLOW | os.O_CLOEXEC
Rename = Callable[[Path, Path], None]


def encode(value: object) -> bytes:
    """Return JSON; arrays become lists, enumerations their values, and what is not finite null."""
    return msgspec.json.encode(value, enc_hook=_plain)


def _plain(value: Any) -> object:
    """Return numpy's scalars and arrays and paths as plain data."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    # The error by which msgspec is told that there is no way to write a value.
    raise NotImplementedError(f"a record cannot hold a {type(value).__name__}")


def read_bytes(path: Path, size: int = -1) -> bytes:
    """Return a file's content, or its first bytes; raises FileNotFoundError, else RecordError."""
    try:
        descriptor = os.open(path, os.O_RDONLY | NO_LINK)
    except FileNotFoundError:
        raise
    except OSError:
        with told("read", path):
            raise
    with told("read", path):
        try:
            if size >= 0:
                return os.read(descriptor, size)
            with open(descriptor, "rb", closefd=False) as file:
                return file.read()
        finally:
            os.close(descriptor)


def read_object(path: Path) -> dict[str, Any]:
    """Return the JSON object in a file; raises FileNotFoundError, else RecordError."""
    try:
        value = msgspec.json.decode(read_bytes(path))
    except NO_JSON as error:
        raise RecordError(f"{path} is no JSON: {error}", "restore it or move it away") from error
    if not isinstance(value, dict):
        raise RecordError(f"{path} holds no JSON object", "restore it or move it away")
    return value


def replace_file(path: Path, data: bytes, *, rename: Rename = os.replace) -> None:
    """Put `data` at `path` so that a reader, or a crash, finds the old content or the new."""
    temporary = path.with_name(f".{path.name}.tmp")
    with told("write", path):
        try:
            _write(temporary, data)
            rename(temporary, path)
        except OSError:
            with suppress(OSError):
                temporary.unlink()
            raise
        sync_folder(path.parent)


def new_file(path: Path, data: bytes) -> None:
    """Write a file into a folder that nobody looks into yet; file and entry are on the disk then.

    Nothing is renamed: one journal commit does, where `replace_file` takes two.
    """
    with told("write", path):
        _write(path, data)
        sync_folder(path.parent)


def _write(path: Path, data: bytes) -> None:
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | NO_LINK
    descriptor = os.open(path, flags, FILE_MODE)
    try:
        write_all(descriptor, data)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_all(descriptor: int, data: bytes) -> None:
    """Write every byte, however many calls that takes."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]


def sync_folder(path: Path) -> None:
    """Make a folder's entries durable."""
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def make_folder(path: Path) -> None:
    """Make a folder and those above it, where they are missing."""
    with told("make the folder", path):
        path.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)


def remove_folder(path: Path) -> None:
    """Remove a folder with what is in it; links inside are removed, not followed."""
    with told("remove", path):
        shutil.rmtree(path)


class LineFile:
    """A file that lines are appended to, each with one write; half a line never stays."""

    def __init__(self, path: Path) -> None:
        self.path = path
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | NO_LINK
        with told("open", path):
            self._descriptor = os.open(path, flags, FILE_MODE)
            self._size = os.fstat(self._descriptor).st_size
        self.lines = 0  # appended by this object
        self._hash = hashlib.sha256()

    @property
    def hash(self) -> str:
        """SHA-256 (hex) of all that this object has appended."""
        return self._hash.hexdigest()

    def append(self, line: bytes, *, durable: bool = False) -> None:
        """Append `line` and a newline; with `durable` it is on the disk when this returns.

        Raises RecordError. A line that could not be written whole is taken back, so that the
        next one starts afresh.
        """
        data = line + b"\n"
        with told("write", self.path):
            try:
                write_all(self._descriptor, data)
            except OSError:
                with suppress(OSError):
                    os.ftruncate(self._descriptor, self._size)
                raise
            self._size += len(data)
            self.lines += 1
            self._hash.update(data)
            if durable:
                os.fsync(self._descriptor)

    def sync(self) -> None:
        """Bring every line to the disk."""
        with told("write", self.path):
            os.fsync(self._descriptor)

    def close(self) -> None:
        """Let go of the file."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)
