"""A session's picture as the page draws over it: marks, residuals, the leg and its stations.

All in px of the picture, from the record alone; nothing is found or solved here.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from legato.geometry.transforms import Array
from legato.records.errors import RecordError
from legato.records.files import read_bytes
from legato.records.record import SessionRecord
from legato.report.scene import Scene, scene_of, silhouette, surface_samples

ARROW_PX = 38.0  # length of the longest residual as it is drawn
SCALES = [m * 10.0**e for e in range(5) for m in (1, 2, 5)]
KEPT = "start-calibrated.png"
CAMERA = "camera"
PNG = b"\x89PNG\r\n\x1a\n"
SOLVED = (
    "accepted", "reasons", "rms_px", "engine", "agreement", "warnings", "missing", "suspects",
    "left_out", "world_from_object", "world_from_camera",
)  # fmt: skip


def view_of(record: SessionRecord) -> dict[str, Any] | None:
    """Return what the page shows of a record's picture, None where there is none to be read.

    Without a calibration it is the bare picture.
    """
    name = picture_name(record)
    size = None if name is None else png_size(record, name)
    if name is None or size is None:
        return None
    view: dict[str, Any] = {
        "session": record.id,
        "boot": record.meta.get("boot"),
        "job": record.meta.get("job"),
        "started": record.meta.get("started"),
        "simulated": bool(record.meta.get("simulated")) and CAMERA in _simulated(record),
        "name": name,
        "size": size,
        "solved": None,
    }
    solved, scene = record.calibration, scene_of(record)
    if solved is not None and scene is not None:
        camera = scene.intrinsics
        if (camera.width, camera.height) == tuple(size) and str(solved.get("picture")) == name:
            view["solved"] = overlay(scene, solved)
    return view


def picture_name(record: SessionRecord) -> str | None:
    """Return the picture that was solved, else the last one taken.

    The copy of an earlier session's solved picture, for replays, is none of this session.
    """
    names = [f"frames/{f.name}" for f in record.frames if f.name != KEPT]
    solved = str((record.calibration or {}).get("picture") or "")
    return solved if solved in names else next(reversed(names), None)


def png_size(record: SessionRecord, name: str) -> list[int] | None:
    """Return a picture's width and height, None where it is no whole PNG."""
    try:
        head = read_bytes(record.path / name)[:24]
    except (RecordError, FileNotFoundError):
        return None
    if head[:8] != PNG or len(head) < 24:
        return None
    return [int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")]


def overlay(scene: Scene, solved: Mapping[str, Any]) -> dict[str, Any]:
    """Return all that is drawn over a solved picture, and what the solution says of itself."""
    residuals = solved.get("residuals") or {}
    largest = max((float(np.hypot(*r)) for r in residuals.values()), default=0.0)
    seen = solved.get("marks") or {}
    marks = {}
    for name, point in scene.leg.marks.items():
        (predicted,) = scene.pixels(np.asarray(point, dtype=float)[None])
        marks[name] = {
            "seen": seen.get(name),
            "predicted": _px(predicted),
            "residual": residuals.get(name),
            "missing": (solved.get("missing") or {}).get(name),
        }
    return {
        **{key: solved.get(key) for key in SOLVED},
        "marks": marks,
        "magnified": magnification(largest),
        "outline": outline(scene),
        "faces": [ring(scene, x) for x in (0.0, scene.leg.length)],
        "stations": [station(scene, s) for s in scene.stations],
    }


def magnification(largest: float) -> float:
    """Return the round factor that draws the largest residual, in px, about as long as an arrow."""
    return max((s for s in SCALES if s * largest <= ARROW_PX), default=1.0) if largest else 1.0


def outline(scene: Scene) -> list[list[float]] | None:
    """Return the leg's projected outline (K, 2), None where a part is behind the camera."""
    pixels = scene.pixels(surface_samples(scene.leg))
    if not np.isfinite(pixels).all():
        return None
    corners = silhouette(pixels)
    moved = np.any(np.diff(corners, axis=0, prepend=np.nan) != 0.0, axis=1)
    return [_px(p) or [] for p in corners[moved]]


def station(scene: Scene, place: float) -> dict[str, Any]:
    """Return a station's point on the top line and its ring, as far as it is seen."""
    (top,) = scene.pixels(scene.leg.surface_point(place)[None])
    return {"station_mm": place, "at": _px(top), "ring": ring(scene, place)}


def ring(scene: Scene, x: float) -> list[list[float] | None]:
    """Return the ring about the leg at `x` (N, 2), None where it is hidden."""
    angle = np.linspace(-np.pi, np.pi, 73)
    pixels = scene.pixels(scene.leg.surface_point(x, angle))
    seen = scene.visible(x, angle)
    return [_px(p) if s else None for p, s in zip(pixels, seen, strict=True)]


def _simulated(record: SessionRecord) -> Sequence[str]:
    """Return which devices were simulated; older records say only that both were."""
    return record.meta.get("simulated_devices") or ("arm", CAMERA)


def _px(pixel: Array) -> list[float] | None:
    """Return a pixel rounded for the wire, None where it is not in front of the camera."""
    return [round(float(v), 2) for v in pixel] if np.isfinite(pixel).all() else None
