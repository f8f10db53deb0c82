"""What labelling weighs: poses that put three marks on three candidates, and what each explains.

A pose counts the marks that face the camera and lie near a candidate whose edges run as a pasted
mark's would.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, distort, pinhole_pixels
from legato.geometry.transforms import Array, apply, rotation_from_vector, transform
from legato.vision.saddle import Candidates
from legato.vision.view import SMALLEST_FACING, View, fit_view

MOST_TRIPLES = 2000  # ordered triples of candidates tried for one triple of marks
LEAST_NEAR = 7  # neighbours that each candidate is combined with
DRAWN_TRIPLES = 300  # of far-off candidates where only neighbours are tried
PRONOUNCED = 12  # first candidates that are combined with one another all the same
SIDES = (7.0, 200.0)  # px that a mark's side measures in a picture
REACH = 24.0  # px at width 768 within which a pose from wrong intrinsics still counts
EDGE_TOLERANCE = np.radians(18.0)
TURNS = np.radians([-12.0, -6.0, 0.0, 6.0, 12.0])  # a hand pastes marks on this straight


@dataclass(frozen=True)
class Target:
    """The leg as labelling needs it: (M, 3) centres and normals, (M, 2, 3) edge directions."""

    leg: Leg
    points: Array
    normals: Array
    along: Array

    @classmethod
    def of(cls, leg: Leg) -> "Target":
        """Take the marks' tangents and normals off the leg."""
        h, names = 0.5, leg.names()
        ends = [leg.mark_surface(n, [[h, 0.0], [-h, 0.0], [0.0, h], [0.0, -h]]) for n in names]
        along = np.array([[e[0] - e[1], e[2] - e[3]] for e in ends])
        normals = np.array(
            [
                (-1.0, 0.0, 0.0) if leg.on_face(n) else leg.surface_normal(leg.mark_angle(n))
                for n in names
            ]
        )
        return cls(leg, leg.points(), normals, along)

    def facing(self, poses: Array) -> Array:
        """Return the cosine (H, M) between marks' normals and the way to the camera."""
        eyes = -np.einsum("hji,hj->hi", poses[:, :3, :3], poses[:, :3, 3])
        away = eyes[:, None] - self.points
        return np.asarray((away * self.normals).sum(-1) / np.linalg.norm(away, axis=-1))


def mark_triples(target: Target, most: int, crowded: bool = False) -> list[tuple[int, ...]]:
    """Return at most so many triples of marks, the most telling first, each mark coming early.

    Large ones tell most. Where places are `crowded` with candidates, compact ones: their images
    are neighbours.
    """
    triples = np.array(list(combinations(range(len(target.points)), 3)))
    p = target.points[triples]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=-1) / 2.0
    together = (
        (target.normals[triples][:, [0, 0, 1]] * target.normals[triples][:, [1, 2, 2]])
        .sum(axis=-1)
        .min(axis=1)
    )
    # Marks that face different ways are seldom seen together, and slivers give no pose.
    value = np.sqrt(area) * (0.4 + np.maximum(together, 0.0))
    if crowded:
        longest = np.linalg.norm(p - p[:, [1, 2, 0]], axis=-1).max(axis=1)
        value = value / longest**2
    used = np.zeros(len(target.points))
    order = []
    for _ in range(min(most, len(triples))):
        k = int(np.argmax(value / (1.0 + used[triples].sum(axis=1))))
        order.append(tuple(int(i) for i in triples[k]))
        used[triples[k]] += 1.0
        value[k] = -1.0
    return order


def crowded(n: int) -> bool:
    """Say whether so many candidates have more ordered triples than can be tried."""
    return n * (n - 1) * (n - 2) > MOST_TRIPLES


def candidate_triples(pixels: Array, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return ordered triples (T, 3) of candidates (N, 2), the most pronounced first.

    All of them, or where that is too many those of the first few, of neighbours, and a draw.
    """
    n = len(pixels)
    all_of = n if not crowded(n) else min(n, PRONOUNCED)
    every = np.stack(np.meshgrid(*[np.arange(all_of)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    if all_of < n:
        near = max(LEAST_NEAR, int(0.5 + np.sqrt(0.25 + MOST_TRIPLES / n)))
        away = np.linalg.norm(pixels[:, None] - pixels, axis=-1)
        neighbours = np.argsort(away, axis=1, kind="stable")[:, 1 : near + 1]
        j, k = (x.ravel() for x in np.meshgrid(np.arange(near), np.arange(near)))
        first = np.repeat(np.arange(n), near * near)
        beside = np.stack([first, neighbours[:, j].ravel(), neighbours[:, k].ravel()], axis=-1)
        drawn = rng.integers(0, n, size=(DRAWN_TRIPLES, 3))
        every = np.unique(np.concatenate([every, beside, drawn]), axis=0)
    i, j, k = every.T
    return np.asarray(every[(i != j) & (j != k) & (i != k)])


def pronounced_triples(n: int) -> NDArray[np.intp]:
    """Return all ordered triples (T, 3) of the few most pronounced of n candidates."""
    few = np.arange(min(n, PRONOUNCED))
    every = np.stack(np.meshgrid(few, few, few, indexing="ij"), axis=-1).reshape(-1, 3)
    i, j, k = every.T
    return np.asarray(every[(i != j) & (j != k) & (i != k)])


def poses_of(
    target: Target,
    triple: tuple[int, ...],
    chosen: NDArray[np.intp],
    pixels: Array,
    nominal: Intrinsics,
) -> Array:
    """Return the poses (H, 4, 4) that put three marks on chosen pixels and facing the camera."""
    matrix, points = nominal.matrix(), target.points[list(triple)]
    none = np.zeros(0)  # the pixels are free of distortion already
    rotations: list[object] = []
    translations: list[object] = []
    for rows in pixels[chosen]:
        _, turns, shifts = cv2.solveP3P(points, rows, matrix, none, cv2.SOLVEPNP_P3P)
        rotations += turns
        translations += shifts
    if not rotations:
        return np.zeros((0, 4, 4))
    r = np.array(rotations, dtype=float)[..., 0]
    t = np.array(translations, dtype=float)[..., 0]
    near, far = (nominal.alpha_u * target.leg.mark_size / side for side in SIDES[::-1])
    depth = t[:, 2]  # of the big face: marks lie within a length of it
    good = np.isfinite(r).all(axis=1) & np.isfinite(t).all(axis=1)
    good &= (depth > near) & (depth < far + target.leg.length)
    poses = transform(rotation_from_vector(r[good]), t[good])
    seen = target.facing(poses)[:, list(triple)].min(axis=1) > SMALLEST_FACING
    return np.asarray(poses[seen])


def view_of_named(named: Mapping[str, Array], leg: Leg, nominal: Intrinsics) -> View | None:
    """Return the view that most marks named at pixels (2,) agree with; None for fewer than four.

    Poses come from triples, so that one wrong name does not spoil the rest.
    """
    names = tuple(named)
    if len(names) < 4:
        return None
    target, pixels = Target.of(leg), np.array([named[n] for n in names])
    points, ideal = leg.points(names), pinhole_pixels(nominal, pixels)
    index = [leg.names().index(n) for n in names]
    best: tuple[float, View] | None = None
    for rows in combinations(range(len(names)), 3):
        triple = tuple(index[k] for k in rows)
        for pose in poses_of(target, triple, np.array([rows]), ideal, nominal):
            off = np.linalg.norm(View(nominal, pose).pixels(points) - pixels, axis=-1)
            value = float(np.minimum(np.nan_to_num(off, nan=np.inf), 30.0).sum())
            if best is None or value < best[0]:
                best = (value, View(nominal, pose))
    if best is None:
        return None
    off = np.linalg.norm(best[1].pixels(points) - pixels, axis=-1)
    near = off < max(30.0, 2.0 * float(np.median(off)))
    if near.sum() < 4:
        return best[1]
    return fit_view(best[1], nominal, points[near], pixels[near], 0.7, rounds=20)[0]


def most_telling(
    poses: Array, candidates: Candidates, target: Target, nominal: Intrinsics
) -> Array:
    """Return the few poses that explain most, first by places, then by the edges' run too."""
    if not len(poses):
        return poses
    reach = REACH * scale_of(nominal)
    value = _explained(poses, candidates, target, nominal, reach, edges=False)
    poses = poses[np.argsort(-value, kind="stable")[:60]]
    value = _explained(poses, candidates, target, nominal, reach, edges=True)
    order = np.argsort(-value, kind="stable")[:6]
    return np.asarray(poses[order[value[order] > 2.0]])


def _explained(
    poses: Array,
    candidates: Candidates,
    target: Target,
    nominal: Intrinsics,
    reach: float,
    edges: bool,
) -> Array:
    """Return for each pose (H,) the marks near candidates, less a part of those in vain."""
    camera = apply(poses, target.points)
    depth = camera[..., 2:]
    ahead = (depth[..., 0] > 1.0) & (target.facing(poses) > SMALLEST_FACING)
    places = distort(nominal, camera[..., :2] / np.maximum(depth, 1.0))
    d = np.linalg.norm(places[:, :, None] - candidates.pixels, axis=-1)
    if edges:
        d = np.where(edges_fit(poses, candidates, target, nominal), d, np.inf)
    near = np.maximum(0.0, 1.0 - d.min(axis=-1) / reach)
    expected = np.asarray(ahead & (nominal.sees(places, 4.0) > 0))
    return np.asarray((near * ahead).sum(axis=1) - 0.2 * (expected & (near == 0.0)).sum(axis=1))


def edges_fit(
    poses: Array, candidates: Candidates, target: Target, nominal: Intrinsics
) -> NDArray[np.bool_]:
    """Say (H, M, N) whether a candidate's edges run as those of a mark there would."""
    camera = apply(poses, target.points)[:, :, None]
    depth = np.maximum(camera[..., 2], 1.0)
    tangent = np.einsum("hij,mkj->hmki", poses[:, :3, :3], target.along)
    image = (tangent[..., :2] - tangent[..., 2:] * camera[..., :2] / depth[..., None]) * [
        nominal.alpha_u,
        nominal.alpha_v,
    ]
    c, s = np.cos(TURNS), np.sin(TURNS)
    turned = np.stack([np.stack([c, s], -1), np.stack([-s, c], -1)], axis=1)  # (T, 2, 2)
    run = np.einsum("tek,hmki->hmtei", turned, image)
    predicted = np.arctan2(run[..., 1], run[..., 0])[:, :, None]  # (H, M, 1, T, 2)
    seen = candidates.edges[None, None, :, None, :]
    straight = _line_angle(predicted - seen).max(axis=-1)
    crossed = _line_angle(predicted - seen[..., ::-1]).max(axis=-1)
    return np.asarray(np.minimum(straight, crossed).min(axis=-1) < EDGE_TOLERANCE)


def scale_of(nominal: Intrinsics) -> float:
    """Return how much larger the picture is than the one that the limits are given for."""
    return max(1.0, nominal.width / 768.0)


def _line_angle(angle: Array) -> Array:
    """Return the size of angles between lines, at most a quarter turn."""
    return np.abs((angle + np.pi / 2.0) % np.pi - np.pi / 2.0)
