"""What goes wrong with records: the file, what was attempted, and what to do about it."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
FORBIDDEN = {errno.EACCES, errno.EPERM, errno.EROFS}


class RecordError(Exception):
    """A record cannot be written or read; `text` says what and where, `hint` what to do."""

    def __init__(self, text: str, hint: str) -> None:
        self.text = text
        self.hint = hint
        super().__init__(f"{text} ({hint})")


@contextmanager
def told(attempt: str, path: Path) -> Iterator[None]:
    """Turn an OSError into a RecordError that says "cannot `attempt` `path`"."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise RecordError(f"cannot {attempt} {path}: {reason}", _hint(error.errno)) from error


def _hint(number: int | None) -> str:
    """Return what to do about an errno."""
    if number in FULL:
        return "free space on that disk, or set records.state_dir to another"
    if number in FORBIDDEN:
        return "make records.state_dir writable for the user that runs legato"
    if number == errno.ELOOP:
        return "records follow no symbolic links; put the real folder or file in its place"
    if number in (errno.ENOENT, errno.ENOTDIR):
        return "check that records.state_dir is a folder and still in place"
    return "check the disk that holds records.state_dir"
