"""The summaries of campaigns on the disk: `state_dir/campaigns/<id>.json`, each replaced whole.

One that has no end when a daemon starts was interrupted; nothing of it goes on.
"""

import secrets
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from legato.daemon.log import Log
from legato.records.errors import RecordError, told
from legato.records.files import encode, make_folder, read_object, replace_file
from legato.records.ids import SESSION_ID, session_id

KEPT: Final = 200
LOOKED_AT: Final = 10  # the latest ones, where one without an end is looked for
LONG: Final = ("sessions", "contacts", "faults", "resets_done")  # left out of lists


class CampaignFiles:
    """The folder of summaries; `token` gives the part of an id that keeps it unique."""

    def __init__(
        self, state_dir: Path, *, token: Callable[[], str] = lambda: secrets.token_hex(2)
    ) -> None:
        self.folder = state_dir / "campaigns"
        self._token = token

    def fresh_id(self, started: str) -> str:
        """Return an id that none has, for one that is started at an ISO time."""
        while True:
            name = session_id(started, self._token())
            if not self._path(name).exists():
                return name

    def write(self, name: str, document: Mapping[str, Any]) -> None:
        """Replace a summary. Raises RecordError."""
        make_folder(self.folder)
        replace_file(self._path(name), encode(document) + b"\n")

    def remove(self, name: str) -> None:
        """Remove a summary, if it is there. Raises RecordError."""
        path = self._path(name)
        with told("remove", path):
            path.unlink(missing_ok=True)

    def ids(self) -> list[str]:
        """Return all ids, newest first. Raises RecordError.

        Of those of one second the newest is the one that was written last.
        """
        with told("read", self.folder):
            found = {path.stem: path.stat().st_mtime_ns for path in self.folder.glob("*.json")}
        names = filter(SESSION_ID.fullmatch, found)
        return sorted(names, key=lambda n: (n.partition("-")[0], found[n]), reverse=True)

    def read(self, name: str) -> dict[str, Any] | None:
        """Return a summary, None where there is none that can be read."""
        if not SESSION_ID.fullmatch(name):
            return None
        with suppress(RecordError, FileNotFoundError):
            return read_object(self._path(name))
        return None

    def heads(self, limit: int) -> list[dict[str, Any]]:
        """Return the latest summaries without their long parts, newest first."""
        found = map(self.read, self.ids()[:limit])
        return [{k: v for k, v in one.items() if k not in LONG} for one in found if one is not None]

    def prune(self) -> None:
        """Remove all but the latest. Raises RecordError."""
        for name in self.ids()[KEPT:]:
            self.remove(name)

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.json"


def close_interrupted(files: CampaignFiles, log: Log) -> None:
    """Give every campaign that has no end the outcome `interrupted`; a disk may refuse that."""
    reason = "the daemon ended while the campaign was under way"
    try:
        for name in files.ids()[:LOOKED_AT]:
            document = files.read(name)
            if document is None or document.get("ended") is not None:
                continue
            closed = document | {"ended": datetime.now(UTC).isoformat(), "outcome": "interrupted"}
            if document.get("session") is not None:
                broken = {"id": document["session"], "outcome": "interrupted", "reason": reason}
                closed["sessions"] = [*document.get("sessions", ()), broken]
                closed["failed"] = document.get("failed", 0) + 1
            files.write(name, closed | {"session": None, "reason": reason})
            log.warning("campaign_interrupted", campaign=name)
    except RecordError as error:
        log.error("campaign_not_kept", text=error.text, hint=error.hint)
