"""Whether a set of marks can give a pose at all, told before solving and without a pose.

The paper's ten marks hold eight in one plane. Coplanar marks fit any picture to a fraction of a
pixel and leave the pose wrong by degrees: a low residual proves nothing, so this gate comes first.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from legato.calibration.problem import Problem
from legato.geometry.leg import PAPER_MARKS, Point
from legato.geometry.transforms import Array

PLANE_TOLERANCE = 0.5  # mm
LEAST_DLT_RATIO = 5e-3  # sound sets of the paper's marks reach 8.8e-3, six and one 2.1e-3
LEAST_FLATNESS = 1e-3  # sound sets reach 0.022


@dataclass(frozen=True)
class Degeneracy:
    """The marks' geometry in figures, what is wrong with it, and the marks that would mend it.

    `refused` says why no pose can be had, or is None. `plane` names the most marks within 0.5 mm of
    one plane. `linear_start` says whether a linear solution may be trusted as a start.
    """

    plane: tuple[str, ...]
    off_plane: tuple[str, ...]
    dlt_ratio: float
    flatness: float
    add: tuple[str, ...]
    refused: str | None = None
    warnings: tuple[str, ...] = ()

    @property
    def linear_start(self) -> bool:
        """Say whether a linear solution of these marks means anything."""
        return len(self.off_plane) > 1 and self.dlt_ratio >= LEAST_DLT_RATIO


def inspect(problem: Problem, marks: Mapping[str, Point] = PAPER_MARKS) -> Degeneracy:
    """Return the report on a problem's marks; `marks` are all those that the leg carries."""
    points, names = np.asarray(problem.points, dtype=float), problem.names
    near, centre, normal = most_coplanar(points)
    off = np.flatnonzero(~near)
    plane = tuple(names[i] for i in np.flatnonzero(near))
    off_plane = tuple(names[i] for i in off)
    ratio, flat = dlt_ratio(points, problem.pixels), flatness(points)
    missing = {n: abs(float((np.array(p) - centre) @ normal)) for n, p in marks.items()}
    add = [n for n, d in missing.items() if n not in names and d > PLANE_TOLERANCE]
    add.sort(key=lambda n: -missing[n])
    wanted = _or(add) if add else "a mark that lies well off that plane"
    refused, warnings = None, []
    if not off.size:
        refused = (
            f"all {len(names)} marks lie within {PLANE_TOLERANCE} mm of one plane: "
            f"any residual fits, no pose follows; add {wanted}"
        )
    elif problem.known is None:
        if off.size == 1:
            warnings.append(
                f"only {off_plane[0]} lies off the plane of the others: the pose rests on it "
                f"alone; add {wanted}"
            )
        elif ratio < LEAST_DLT_RATIO or flat < LEAST_FLATNESS:
            warnings.append(
                f"the marks are nearly flat (DLT ratio {ratio:.1e}, flatness {flat:.1e}); "
                f"add {wanted}"
            )
    return Degeneracy(plane, off_plane, ratio, flat, tuple(add), refused, tuple(warnings))


def most_coplanar(points: Array) -> tuple[NDArray[np.bool_], Array, Array]:
    """Return which points (M,) lie within tolerance of the fullest plane, its centre and normal."""
    triples = np.array(list(combinations(range(len(points)), 3)))
    a, b, c = (points[triples[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    spread = np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    sound = size[:, 0] > 1e-3 * spread**2
    if not sound.any():
        return np.ones(len(points), dtype=bool), points.mean(axis=0), np.array([0.0, 0.0, 1.0])
    normals, a = (normals / np.maximum(size, 1e-300))[sound], a[sound]
    distance = np.abs(np.einsum("tk,tmk->tm", normals, points[None] - a[:, None]))
    near = distance <= PLANE_TOLERANCE
    chosen = near[int(np.argmax(near.sum(axis=1)))]
    # The plane through three marks that are close together misses far ones: fit it to all it has.
    for _ in range(3):
        centre = points[chosen].mean(axis=0)
        normal = np.linalg.svd(points[chosen] - centre)[2][2]
        wider = np.abs((points - centre) @ normal) <= PLANE_TOLERANCE
        if wider.sum() <= chosen.sum():
            break
        chosen = wider
    return chosen, centre, normal


def dlt_ratio(points: Array, pixels: Array) -> float:
    """Return sigma11 / sigma1 of the normalised linear system: near zero where it has no answer."""
    p, x = _normalised(points), _normalised(np.asarray(pixels, dtype=float))
    one = np.concatenate([p, np.ones((len(p), 1))], axis=1)
    zero = np.zeros_like(one)
    rows = np.concatenate(
        [
            np.concatenate([one, zero, -x[:, :1] * one], axis=1),
            np.concatenate([zero, one, -x[:, 1:] * one], axis=1),
        ]
    )
    sigma = np.linalg.svd(rows, compute_uv=False)
    return float(sigma[10] / sigma[0]) if len(sigma) > 10 else 0.0


def flatness(points: Array) -> float:
    """Return the least thickness over length of the marks when any one of them is left out."""
    keep = ~np.eye(len(points), dtype=bool)
    rest = np.stack([points[k] for k in keep])
    sigma = np.linalg.svd(rest - rest.mean(axis=1, keepdims=True), compute_uv=False)
    return float((sigma[:, 2] / np.maximum(sigma[:, 0], 1e-300)).min())


def _normalised(points: Array) -> Array:
    """Return points (M, D) about their centre with a mean distance of root D."""
    centred = points - points.mean(axis=0)
    mean = max(float(np.linalg.norm(centred, axis=1).mean()), 1e-300)
    return np.asarray(centred * (np.sqrt(points.shape[1]) / mean))


def _or(names: list[str]) -> str:
    return " or ".join(names[:2])
