"""The intrinsics file: what calibrating the camera from many views found, with its error.

TOML with alpha_u alpha_v u0 v0 (px), k1 k2, covariance (6x6 in that order), width height (px),
views, rms_px and created (ISO time); residuals by view and by mark; and, where they were asked
for, the marks' own places.
"""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from legato.calibration.problem import KnownIntrinsics
from legato.config.decode import decode, read_toml
from legato.config.errors import ConfigError
from legato.config.toml import dumps
from legato.geometry.projection import Intrinsics

Positive = Annotated[float, Meta(gt=0)]
Row = tuple[float, float, float, float, float, float]
SMALLEST_EIGENVALUE = -1e-9  # of a covariance scaled to a unit diagonal; rounding stays above

COMMENT = """The camera's intrinsics, made by `legato intrinsics` from pictures of the leg model.
alpha_u, alpha_v, u0, v0 in px; k1, k2 radial distortion without unit, in OpenCV's convention.
covariance: of alpha_u, alpha_v, u0, v0, k1, k2, in that order. They hold for this picture size.
view_rms_px, mark_rms_px: residuals by picture and by mark. marks: their places (mm) as the pictures
show them, where they were asked for: put them into [leg.marks] to use them."""


class IntrinsicsFile(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The file's keys."""

    alpha_u: Positive
    alpha_v: Positive
    u0: float
    v0: float
    k1: float
    k2: float
    covariance: tuple[Row, Row, Row, Row, Row, Row]
    width: Annotated[int, Meta(ge=1)]
    height: Annotated[int, Meta(ge=1)]
    views: Annotated[int, Meta(ge=1)]
    rms_px: Annotated[float, Meta(ge=0)]
    created: str
    view_rms_px: tuple[float, ...] = ()
    mark_rms_px: dict[str, float] = {}
    marks: dict[str, tuple[float, float, float]] = {}

    def dated(self) -> datetime:
        """Return when the camera was calibrated; a date without a zone counts as UTC."""
        made = datetime.fromisoformat(self.created)
        return made if made.tzinfo else made.replace(tzinfo=UTC)

    def known(self) -> KnownIntrinsics:
        """Return what the calibration is given."""
        return KnownIntrinsics(
            Intrinsics(
                alpha_u=self.alpha_u,
                alpha_v=self.alpha_v,
                u0=self.u0,
                v0=self.v0,
                k1=self.k1,
                k2=self.k2,
                width=self.width,
                height=self.height,
            ),
            np.array(self.covariance, dtype=float),
        )


def read_intrinsics(file: Path) -> IntrinsicsFile:
    """Return the intrinsics in `file`. Raises ConfigError naming key, value and expectation."""
    found = decode(read_toml(file, "an intrinsics file"), IntrinsicsFile, file)
    covariance = np.array(found.covariance)
    if problem := covariance_problem(covariance):
        raise ConfigError(file, "covariance", problem, "a symmetric covariance, 6x6")
    for name, value, size in (("u0", found.u0, found.width), ("v0", found.v0, found.height)):
        if not 0 <= value <= size:
            raise ConfigError(file, name, value, f"a place in the picture, 0 to {size}")
    try:
        datetime.fromisoformat(found.created)
    except ValueError as error:
        raise ConfigError(file, "created", found.created, "an ISO date and time") from error
    return found


def covariance_problem(covariance: np.ndarray) -> str:
    """Return why a 6x6 matrix is no covariance, or an empty text."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.where(scale > 0.0, scale, 1.0)
    scaled = covariance / np.outer(unit, unit)
    if np.diag(covariance).min() < 0.0:
        return "a negative variance"
    if np.abs(scaled - scaled.T).max() > 1e-6:
        return "a matrix that is not symmetric"
    smallest = float(np.linalg.eigvalsh((scaled + scaled.T) / 2.0).min())
    return f"an eigenvalue of {smallest:.2g}" if smallest < SMALLEST_EIGENVALUE else ""


def write_intrinsics(
    file: Path,
    known: KnownIntrinsics,
    *,
    views: int,
    rms_px: float,
    created: str,
    view_rms_px: Sequence[float] = (),
    mark_rms_px: Mapping[str, float] | None = None,
    marks: Mapping[str, Sequence[float]] | None = None,
) -> IntrinsicsFile:
    """Write `file`, replacing it whole, and return what stands in it.

    `created` is an ISO date and time; `marks` are places in mm, where they were estimated. Raises
    OSError, and ConfigError where the values are such that the file would be refused.
    """
    i = known.intrinsics
    rows = np.asarray(known.covariance, dtype=float).tolist()
    document = {
        "alpha_u": float(i.alpha_u),
        "alpha_v": float(i.alpha_v),
        "u0": float(i.u0),
        "v0": float(i.v0),
        "k1": float(i.k1),
        "k2": float(i.k2),
        "width": int(i.width),
        "height": int(i.height),
        "views": int(views),
        "rms_px": float(rms_px),
        "created": created,
        "view_rms_px": [float(v) for v in view_rms_px],
        "covariance": rows,
        "mark_rms_px": {n: float(v) for n, v in (mark_rms_px or {}).items()},
        "marks": {n: [float(x) for x in p] for n, p in (marks or {}).items()},
    }
    # What is not known has no place in the file.
    document = {name: value for name, value in document.items() if value or value == 0}
    new = file.with_name(f".{file.name}.new")
    new.write_text(dumps(document, COMMENT), encoding="utf-8")
    try:
        found = read_intrinsics(new)
    except ConfigError:
        new.unlink()
        raise
    new.replace(file)
    return found
