"""Sessions side by side: what differs between them, and how well they repeat.

Poses are compared with their mean, contacts by station; nothing is drawn here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from legato.geometry.transforms import Array, apply
from legato.records.record import SessionRecord
from legato.report import facts
from legato.report.devices import cell
from legato.report.figures.curves import Stay
from legato.report.posed import posed
from legato.report.score import Score, score
from legato.report.touches import contacts, counted

ABSENT = "\N{EN DASH}"
LONGEST = 32  # characters of a value that is shown
NOT_COMPARED = ("server.", "records.")  # where a daemon listens and writes changes nothing


@dataclass(frozen=True)
class Pose:
    """Where the leg was found against the sessions' mean: shift in mm, turn about x y z in deg."""

    shift_mm: tuple[float, float, float]
    turn_deg: tuple[float, float, float]


@dataclass(frozen=True)
class Side:
    """One session's own figures; None where it has none.

    `seconds` are the wall's; `stays` has the cell's seconds by state, `course` each stay in order.
    """

    number: int
    id: str
    job: str
    outcome: str | None
    reason: str | None
    simulated: bool
    cell: str
    started: str | None
    seconds: float | None
    engine: str | None
    rms_px: float | None
    sigma_mm: float | None
    strokes: int
    contact_mm: float | None
    error_mm: float | None
    pose: Pose | None
    stays: dict[str, float]
    course: tuple[Stay, ...]


@dataclass(frozen=True)
class Station:
    """One station over all sessions: touched over predicted height, mm.

    `contacts` has each session's strokes. `between` is the standard deviation of the sessions'
    means, `within` that of strokes about their own session's mean, `span` the whole range.
    """

    station_mm: float
    contacts: tuple[tuple[float, ...], ...]
    mean: float | None
    between: float | None
    within: float | None
    span: float | None


@dataclass(frozen=True)
class Difference:
    """One key of the configuration that is not the same in all sessions."""

    key: str
    values: tuple[str, ...]

    def told(self) -> str:
        """Return each value once, cut where it is long, with the sessions that have it."""
        numbers: dict[str, list[str]] = {}
        for number, value in enumerate(self.values, start=1):
            numbers.setdefault(value, []).append(str(number))
        cut = {v: v if len(v) <= LONGEST else f"{v[: LONGEST - 1]}\u2026" for v in numbers}
        return "; ".join(f"{cut[v]} ({', '.join(own)})" for v, own in numbers.items())


@dataclass(frozen=True)
class Comparison:
    """Sessions in the order given, stations in order, and what was configured differently."""

    sides: tuple[Side, ...]
    stations: tuple[Station, ...]
    differences: tuple[Difference, ...]
    pose_sd_mm: tuple[float, float, float] | None
    pose_sd_deg: tuple[float, float, float] | None

    @property
    def mixed(self) -> bool:
        """Whether simulated and real sessions stand side by side."""
        return len({side.cell for side in self.sides}) > 1

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON-able data."""
        return asdict(self)


def compare(records: Sequence[SessionRecord]) -> Comparison:
    """Return sessions side by side; raises ValueError for fewer than two."""
    if len(records) < 2:
        raise ValueError("one session has nothing beside it: name two or more")
    records = [posed(r) for r in records]
    scores = [score(r) for r in records]
    poses = _poses([(r.calibration or {}).get("world_from_object") for r in records])
    sides = [
        _side(number, record, told, pose)
        for number, (record, told, pose) in enumerate(
            zip(records, scores, poses, strict=True), start=1
        )
    ]
    found = [p for p in poses if p is not None]
    several = len(found) > 1
    return Comparison(
        sides=tuple(sides),
        stations=_stations(records),
        differences=_differences([r.meta.get("config") or {} for r in records]),
        pose_sd_mm=_spread([p.shift_mm for p in found]) if several else None,
        pose_sd_deg=_spread([p.turn_deg for p in found]) if several else None,
    )


def _side(number: int, record: SessionRecord, told: Score, pose: Pose | None) -> Side:
    """Return one session's figures."""
    solved, meta = record.calibration or {}, record.meta
    sigmas = [s.get("sigma_mm") for s in solved.get("stations") or ()]
    heights = [float(c["contact_mm"]) for c in counted(contacts(record))]
    stays: dict[str, float] = {}
    course = tuple(facts.stays(record))
    for stay in course:
        stays[stay.state] = stays.get(stay.state, 0.0) + stay.seconds
    return Side(
        number=number,
        id=record.id,
        job=str(meta.get("job", "unknown")),
        outcome=meta.get("outcome"),
        reason=meta.get("reason"),
        simulated=bool(meta.get("simulated")),
        cell=cell(meta),
        started=meta.get("started"),
        seconds=facts.duration(record),
        engine=solved.get("engine"),
        rms_px=solved.get("rms_px"),
        sigma_mm=max((float(s) for s in sigmas if s is not None), default=None),
        strokes=len(heights),
        contact_mm=float(np.mean(heights)) if heights else None,
        error_mm=told.worst_mm,
        pose=pose,
        stays=stays,
        course=course,
    )


def _poses(found: Sequence[Any]) -> list[Pose | None]:
    """Return each session's leg against the mean of all: shift of its middle, turn about W's axes.

    The middle, not the origin: a turn about a far end would count as a shift.
    """
    from scipy.spatial.transform import Rotation

    known = [np.asarray(m, dtype=float) for m in found if m is not None]
    if not known:
        return [None] * len(found)
    middles = np.stack([apply(m, MIDDLE[None])[0] for m in known])
    mean_turn = Rotation.from_matrix(np.stack([m[:3, :3] for m in known])).mean()
    mean_middle = middles.mean(axis=0)
    poses: list[Pose | None] = []
    for matrix in found:
        if matrix is None:
            poses.append(None)
            continue
        world_from_object = np.asarray(matrix, dtype=float)
        shift = apply(world_from_object, MIDDLE[None])[0] - mean_middle
        turn = Rotation.from_matrix(world_from_object[:3, :3]) * mean_turn.inv()
        poses.append(Pose(_three(shift), _three(np.degrees(turn.as_rotvec()))))
    return poses


MIDDLE = np.array([97.0, 0.0, 0.0])  # about the middle of the stations, in the leg's frame


def _stations(records: Sequence[SessionRecord]) -> tuple[Station, ...]:
    """Return every station that any session touched."""
    touched = [[(float(c["station_mm"]), float(c["contact_mm"])) for c in counted(contacts(r))]
               for r in records]  # fmt: skip
    places = sorted({station for strokes in touched for station, _ in strokes})
    return tuple(
        _station(place, [[h for s, h in strokes if s == place] for strokes in touched])
        for place in places
    )


def _station(place: float, contacts: Sequence[Sequence[float]]) -> Station:
    """Return one station's spread."""
    heights = [h for own in contacts for h in own]
    means = [float(np.mean(own)) for own in contacts if own]
    apart = [h - float(np.mean(own)) for own in contacts for h in own]
    freedom = len(heights) - len(means)
    return Station(
        station_mm=place,
        contacts=tuple(tuple(own) for own in contacts),
        mean=float(np.mean(means)) if means else None,
        between=float(np.std(means, ddof=1)) if len(means) > 1 else None,
        within=float(np.sqrt(np.sum(np.square(apart)) / freedom)) if freedom > 0 else None,
        span=max(heights) - min(heights) if heights else None,
    )


def _differences(configs: Sequence[Mapping[str, Any]]) -> tuple[Difference, ...]:
    """Return the keys whose values are not the same in all sessions, in the files' order."""
    flat = [
        {f"{table}.{key}" if table else key: value
         for table, lines in facts.settings(config) for key, value in lines}
        for config in configs
    ]  # fmt: skip
    keys = dict.fromkeys(key for lines in flat for key in lines)
    found = []
    for key in keys:
        values = tuple(lines.get(key, ABSENT) for lines in flat)
        if len(set(values)) > 1 and not key.startswith(NOT_COMPARED):
            found.append(Difference(key, values))
    return tuple(found)


def _spread(rows: Sequence[tuple[float, float, float]]) -> tuple[float, float, float]:
    """Return the standard deviation of each column."""
    return _three(np.std(np.asarray(rows), axis=0, ddof=1))


def _three(values: Array) -> tuple[float, float, float]:
    a, b, c = (float(v) for v in values)
    return a, b, c
