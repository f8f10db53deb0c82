"""The pose that a job worked by where an earlier session had found it: `massage`, `home`.

Such a record keeps the picture that its pose was solved from. The session that took it is known by
that picture, byte for byte; where it is gone from the store the picture is solved anew, which gives
the same pose every time.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec

from legato.control.effects import CellFault
from legato.records.errors import RecordError
from legato.records.files import read_bytes
from legato.records.record import SessionRecord, read_session

LENT = ("massage",)  # jobs that press by an earlier pose; others only keep clear of the leg


@dataclass
class Posed(SessionRecord):
    """A record with the calibration that its job began with.

    `lender` is the session that found it, None where it was solved anew from the picture.
    """

    lent: dict[str, Any] = field(default_factory=dict)
    lender: str | None = None

    @cached_property
    def calibration(self) -> dict[str, Any] | None:
        """The calibration that the job began with."""
        return self.lent


def posed(record: SessionRecord) -> SessionRecord:
    """Return a record with the pose that its job began with; itself where it has its own or none.

    Whoever reads the result sees that pose as `calibration`.
    """
    own = record.calibration
    if own is not None or isinstance(record, Posed):
        return record
    start = record.document("start") or {}
    place = start.get("calibrated")
    if not isinstance(place, str):
        return record
    found, lender = _lent(record, place) or (None, None)
    if found is None:
        found = _solved_anew(record, place, start.get("picks"))
    if found is None:
        return record
    lent = found | {"picture": place}
    return Posed(record.path, record.meta, record.events, record.torn, record.damage, lent, lender)


def pose_of(record: SessionRecord) -> dict[str, Any] | None:
    """Return where the pose comes from, as the page tells it: None where it is the session's own.

    `id` is the session that found it, `text` a sentence.
    """
    if not isinstance(record, Posed):
        return None
    found = "by the pose that session {} found" if record.lender else "by an earlier pose"
    verb = "Pressed" if record.meta.get("job") in LENT else "Begun"
    text = f"{verb} {found.format(record.lender)}; this session solved none."
    if record.lender is None:
        text += " The session that found it is not beside this one: its picture was solved anew."
    return {"id": record.lender, "text": text}


def _lent(record: SessionRecord, place: str) -> tuple[dict[str, Any], str] | None:
    """Return the newest earlier calibration that was made from the same picture, and its id."""
    try:
        picture = read_bytes(record.path / place)
    except (FileNotFoundError, RecordError):
        return None
    for path in sorted(record.path.parent.iterdir(), reverse=True):
        with suppress(RecordError, OSError):  # whatever else lies there lends nothing
            if path.name >= record.path.name or not (path / "calibration.json").is_file():
                continue
            if any(frame == picture for frame in _alike(path, len(picture))):
                solved = read_session(path).calibration
                if solved is not None:
                    return solved, path.name
    return None


def _alike(path: Path, size: int) -> Iterator[bytes]:
    """Yield a session's pictures that have so many bytes."""
    for frame in (path / "frames").glob("*.png"):
        with suppress(OSError):
            if frame.stat().st_size == size:
                yield frame.read_bytes()


def _solved_anew(record: SessionRecord, place: str, picks: Any) -> dict[str, Any] | None:
    """Return what the kept picture gives by the record's own configuration, None where nothing."""
    from legato.config.build import cell_settings
    from legato.config.intrinsics import IntrinsicsFile
    from legato.config.load import Loaded
    from legato.config.schema import Config
    from legato.control.document import document
    from legato.control.perceive import perceive
    from legato.vision.picture import PictureError, decode

    data, lens = record.meta.get("config"), record.meta.get("intrinsics")
    try:
        config = msgspec.convert(data, Config)
        intrinsics = msgspec.convert(lens, IntrinsicsFile) if lens is not None else None
        told = Loaded(config, Path("session.json"), "", dict(data or {}), intrinsics)
        settings = cell_settings(told)
        named = None if picks is None else {n: (float(u), float(v)) for n, (u, v) in picks.items()}
        image = decode(read_bytes(record.path / place))
        solved = perceive(image, settings, seed=settings.calibration.seed, picks=named)
    except (msgspec.ValidationError, FileNotFoundError, RecordError, PictureError, CellFault,
            TypeError, ValueError):  # fmt: skip
        return None
    return document(solved, settings)
