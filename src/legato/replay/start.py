"""What a recorded job began with: its settings, and what the cell knew, made anew from the record.

Raises RecordError where the record lacks what replay needs.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from legato.config.build import cell_settings
from legato.config.intrinsics import IntrinsicsFile
from legato.config.load import Loaded
from legato.config.schema import Config
from legato.control.memory import Memory
from legato.control.perceive import perceive
from legato.control.settings import CellSettings
from legato.geometry.motion import Steps
from legato.hal.camera import Frame
from legato.records.errors import RecordError
from legato.records.files import read_bytes
from legato.records.record import SessionRecord
from legato.vision.picture import PictureError, decode

OLDER = "it was made by a version of legato that could not be replayed yet"


@dataclass(frozen=True)
class Start:
    """The job, the cell's settings and knowledge, and the cell's clock in s."""

    job: str
    settings: CellSettings
    memory: Memory
    now: float


def start_of(record: SessionRecord) -> Start:
    """Return what the record's job began with; a calibration is solved from its picture again."""
    start = record.document("start")
    if start is None or not record.effects:
        raise RecordError(f"{record.path} has no start.json or no effects.jsonl", OLDER)
    settings = settings_of(record)
    try:
        memory = Memory(
            reference=_steps(start["reference"]),
            registers=_steps(start["registers"]),
            verified_at=start["verified_at"],
            picks=_picks(start["picks"]),
        )
        if start["frame"] is not None:
            memory.frame = frame_of(record, start["frame"], {})
        if start["calibrated"] is not None:
            picture = frame_of(record, start["calibrated"], {}).image
            seed = settings.calibration.seed
            memory.calibration = perceive(picture, settings, seed=seed, picks=memory.picks)
        return Start(str(start["job"]), settings, memory, float(start["now"]))
    except (KeyError, TypeError, ValueError) as error:
        raise RecordError(f"{record.path}/start.json is damaged: {error}", "restore it") from error


def settings_of(record: SessionRecord) -> CellSettings:
    """Return the settings of the configuration that the record holds."""
    data, lens = record.meta.get("config"), record.meta.get("intrinsics")
    try:
        config = msgspec.convert(data, Config)
        intrinsics = msgspec.convert(lens, IntrinsicsFile) if lens is not None else None
    except msgspec.ValidationError as error:
        text = f"{record.path}/session.json: its configuration does not fit this version: {error}"
        raise RecordError(text, "replay it with the version that session.json names") from error
    hash_ = str(record.meta.get("config_hash"))
    return cell_settings(Loaded(config, Path("session.json"), hash_, dict(data or {}), intrinsics))


def frame_of(record: SessionRecord, place: str, told: Mapping[str, Any]) -> Frame:
    """Return a recorded picture with what was told of it."""
    try:
        image = decode(read_bytes(record.path / place))
    except (FileNotFoundError, PictureError) as error:
        text = f"{record.path} lacks its picture {place}: {error}"
        raise RecordError(text, "`legato sessions verify` says what else is missing") from error
    age, number = float(told.get("age_s", 0.0)), int(told.get("sequence", 0))
    return Frame(image, age, number, str(told.get("source", "record")))


def _steps(told: Any) -> Steps | None:
    if told is None:
        return None
    one, two, three, four, five, six = (int(v) for v in told)
    return one, two, three, four, five, six


def _picks(told: Any) -> dict[str, tuple[float, float]] | None:
    if told is None:
        return None
    return {str(name): (float(u), float(v)) for name, (u, v) in told.items()}
