"""How well a session did, and, where it was simulated, what truly happened.

Only truth.json is believed for what was touched; the trajectory says which touch was meant where.
A real session has no truth: its errors are None.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from legato.geometry.leg import Leg
from legato.geometry.transforms import angle_between
from legato.records.record import SessionRecord
from legato.report.scene import leg_of, stations_of
from legato.report.strokes import Stroke, began, strokes_of
from legato.report.touches import contacts as contacts_of
from legato.report.touches import counted

Happening = Mapping[str, Any]


@dataclass(frozen=True)
class PoseError:
    """How far the estimated leg is from the true one: its turn, and the shift of its origin."""

    rotation_deg: float
    translation_mm: float


@dataclass(frozen=True)
class TouchError:
    """One stroke's first true touch: where on the true leg, how far from the station, how hard."""

    station_mm: float
    stroke: int
    along_mm: float
    across_mm: float
    error_mm: float
    depth_mm: float
    force_n: float


@dataclass(frozen=True)
class StationScore:
    """One station, each figure a mean over its strokes, `error_mm` the worst true one.

    Predicted and touched height are z in the robot base frame, `contact_mm` is the touched over
    the predicted height along the normal, `place_mm` the place along the estimated leg.
    """

    station_mm: float
    strokes: int
    predicted_z_mm: float | None
    touched_z_mm: float | None
    contact_mm: float | None
    place_mm: float | None
    error_mm: float | None


@dataclass(frozen=True)
class Score:
    """A session's stations in order, and the errors where the truth is known.

    `touches` has each stroke's first true touch; `stray` are touches outside every stroke, and
    `breaches` what must never happen, both as the simulated world tells them.
    """

    stations: tuple[StationScore, ...]
    pose_error: PoseError | None
    touches: tuple[TouchError, ...] = ()
    stray: tuple[Happening, ...] = ()
    breaches: tuple[Happening, ...] = ()
    known: bool = False

    @property
    def worst_mm(self) -> float | None:
        """The largest error of a station."""
        return max((s.error_mm for s in self.stations if s.error_mm is not None), default=None)

    def as_json(self) -> dict[str, Any]:
        """Return the score as JSON-able data."""
        return asdict(self) | {"worst_mm": self.worst_mm}


def score(record: SessionRecord) -> Score:
    """Return how well a session did; parts that its record does not have are None or empty."""
    truth = record.truth or {}
    spans = strokes_of(record)
    met = [
        (touch, _stroke_at(touch, spans))
        for touch in _of_session(record, truth.get("touches") or (), "began_s")
    ]
    touches = _first_touches(leg_of(record), met)
    contacts = counted(contacts_of(record))
    return Score(
        stations=tuple(_station(s, contacts, touches) for s in stations_of(record)),
        pose_error=_pose_error(record.calibration or {}, truth),
        touches=touches,
        stray=tuple(touch for touch, stroke in met if stroke is None),
        breaches=tuple(_of_session(record, truth.get("breaches") or (), "t_s")),
        known=record.truth is not None,
    )


def _of_session(record: SessionRecord, happened: Sequence[Happening], when: str) -> list[Happening]:
    """Return what happened since the session's first motion: a world remembers earlier ones."""
    start = began(record)
    return [] if start is None else [h for h in happened if float(h[when]) >= start]


def _stroke_at(touch: Happening, spans: Sequence[Stroke]) -> Stroke | None:
    """Return the stroke during which the fingertip met the leg, None for any other touch."""
    if touch.get("surface", "leg") != "leg":
        return None
    return next((s for s in spans if s.holds(float(touch["began_s"]))), None)


def _first_touches(
    leg: Leg, met: Sequence[tuple[Happening, Stroke | None]]
) -> tuple[TouchError, ...]:
    """Return each stroke's first touch with its distance from the station's place on the leg."""
    first: dict[tuple[float, int], tuple[Stroke, TouchError]] = {}
    for touch, stroke in met:
        if stroke is None:
            continue
        known = first.get((stroke.station, stroke.number))
        if known is not None and known[0] == stroke:
            continue  # an attempt that a later one has replaced counts no more
        place = np.asarray(touch["object_mm"], dtype=float)
        first[stroke.station, stroke.number] = (
            stroke,
            TouchError(
                station_mm=stroke.station,
                stroke=stroke.number,
                along_mm=float(place[0]),
                across_mm=float(place[1]),
                error_mm=float(np.linalg.norm(place - leg.surface_point(stroke.station))),
                depth_mm=float(touch.get("depth_mm") or 0.0),
                force_n=float(touch.get("force_n") or 0.0),
            ),
        )
    return tuple(error for _, error in first.values())


def _pose_error(calibration: Happening, truth: Happening) -> PoseError | None:
    """Return the error of the estimated pose, None without an estimate or a truth."""
    if "world_from_object" not in calibration or "world_from_object" not in truth:
        return None
    found = np.asarray(calibration["world_from_object"], dtype=float)
    true = np.asarray(truth["world_from_object"], dtype=float)
    turn = float(np.degrees(angle_between(found[:3, :3], true[:3, :3])))
    return PoseError(turn, float(np.linalg.norm(found[:3, 3] - true[:3, 3])))


def _station(
    station: float, contacts: Sequence[Happening], touches: Sequence[TouchError]
) -> StationScore:
    """Return one station's line."""
    own = [c for c in contacts if float(c["station_mm"]) == station]
    return StationScore(
        station_mm=station,
        strokes=len(own),
        predicted_z_mm=_mean([c["predicted_xyz_mm"][2] for c in own]),
        touched_z_mm=_mean([c["xyz_mm"][2] for c in own]),
        contact_mm=_mean([c["contact_mm"] for c in own]),
        place_mm=_mean([c["place_mm"] for c in own]),
        error_mm=max((t.error_mm for t in touches if t.station_mm == station), default=None),
    )


def _mean(values: Sequence[float]) -> float | None:
    """Return the mean, None of nothing."""
    return float(np.mean(values)) if values else None
