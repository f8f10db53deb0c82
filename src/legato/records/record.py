"""A session's record as it is read: whatever is there, up to a tear; what is missing is None."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from legato.records.chain import EFFECTS, SESSION, read_events, split_lines
from legato.records.errors import RecordError
from legato.records.files import NO_JSON, read_bytes, read_object
from legato.records.session import FRAMES, TRAJECTORY
from legato.records.trajectory import parse

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass
class SessionRecord:
    """One session: `meta` is session.json, `events` are dicts in order, up to a tear (`torn`).

    Larger parts are read when they are first asked for. `damage` has a sentence for each part
    that is there and cannot be read.
    """

    path: Path
    meta: dict[str, Any]
    events: list[dict[str, Any]]
    torn: bool
    damage: list[str] = field(default_factory=list)

    @property
    def id(self) -> str:
        """The session's id."""
        return self.path.name

    @property
    def finished(self) -> bool:
        """Whether the session has an outcome."""
        return self.meta.get("outcome") is not None

    @cached_property
    def calibration(self) -> dict[str, Any] | None:
        """calibration.json, None where the session has none."""
        return self.document("calibration")

    @cached_property
    def truth(self) -> dict[str, Any] | None:
        """truth.json: what truly happened, in simulated sessions only."""
        return self.document("truth")

    @cached_property
    def trajectory(self) -> "dict[str, NDArray[Any]]":
        """Columns (N,) by name; see records.trajectory. No rows where the arm did not move."""
        try:
            return parse(read_bytes(self.path / TRAJECTORY))
        except FileNotFoundError:
            return parse(b"")
        except RecordError as error:
            self.damage.append(error.text)
            return parse(b"")

    @cached_property
    def effects(self) -> list[dict[str, Any]]:
        """The lines of effects.jsonl up to a tear; none where the session has no such file."""
        try:
            lines, _ = split_lines(read_bytes(self.path / EFFECTS))
        except FileNotFoundError:
            return []
        found: list[dict[str, Any]] = []
        for line in lines:
            try:
                value = msgspec.json.decode(line)
            except NO_JSON:
                value = None
            if not isinstance(value, dict):
                self.damage.append(f"{EFFECTS}: line {len(found) + 1} is none")
                break
            found.append(value)
        return found

    @cached_property
    def frames(self) -> list[Path]:
        """The pictures' files, by name."""
        found = (self.path / FRAMES).glob("*.png")
        return sorted(f for f in found if f.is_file() and not f.is_symlink())

    def document(self, name: str) -> dict[str, Any] | None:
        """Return `name`.json, None where it is missing or damaged."""
        try:
            return read_object(self.path / f"{name}.json")
        except FileNotFoundError:
            return None
        except RecordError as error:
            self.damage.append(error.text)
            return None

    def of_kind(self, kind: str) -> list[dict[str, Any]]:
        """Return the events of one kind in order."""
        return [e for e in self.events if e["kind"] == kind]


def read_session(path: Path) -> SessionRecord:
    """Read a session's folder; raises RecordError where it is none or session.json is damaged."""
    if path.is_symlink():
        raise RecordError(
            f"{path} is a symbolic link", "records follow none; give the folder itself"
        )
    try:
        meta = read_object(path / SESSION)
    except FileNotFoundError as error:
        raise RecordError(
            f"{path} holds no session", "`legato sessions` lists those there are"
        ) from error
    events, torn = read_events(path)
    return SessionRecord(path, meta, events, torn)
