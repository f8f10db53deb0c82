"""Marks by hand: what a person's picks snap to in a recorded picture, before they are sent.

The daemon snaps the same picks in its own picture again; this only shows what it will find.
"""

from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from legato.control.perceive import pick_marks
from legato.control.settings import CellSettings
from legato.vision.picture import decode


class SnapAsked(Struct, frozen=True, forbid_unknown_fields=True):
    """A picture of a session, and the places (u, v) in px that a person named."""

    session: str
    name: str
    picks: dict[str, tuple[float, float]]


def snapped(picture: bytes, picks: Mapping[str, Any], settings: CellSettings) -> dict[str, Any]:
    """Return the marks that picks snap to, `marks` {name: [u, v, sigma]}, and why others do not.

    Raises MarksNotFound for a picture of another size or an unknown name, PictureError.
    """
    image = decode(picture)
    found = pick_marks(image, settings, seed=settings.calibration.seed, picks=picks)
    return {
        "marks": {n: [round(m.u, 3), round(m.v, 3), m.sigma] for n, m in found.marks.items()},
        "missing": {n: why for n, why in found.missing.items() if n in picks},
    }
