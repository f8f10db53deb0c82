"""Candidates for marks: places where four sectors, bright and dark in turn, meet.

A saddle of the smoothed grey levels (the negative determinant of the Hessian) proposes, a ring of
samples around it decides. Nothing here knows the leg.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from legato.geometry.transforms import Array
from legato.vision.picture import Grey

Levels = NDArray[np.float32]

SMOOTHING = 1.6  # px at a picture width of 768
LEAST_CONTRAST = 5.0  # grey levels from the mean to white or black
MOST_PROPOSALS = 400
RADII = (2.6, 4.0, 6.0)  # px at a picture width of 768
SPOKES = 48
FEW, COARSER = 9, 1.8  # places below which a picture may be blurred, and the scale to look at then
NEW = 8.0  # px from every place already found


@dataclass(frozen=True)
class Candidates:
    """Places that look like a mark's centre, the most pronounced first.

    `pixels` (N, 2); `contrast` (N,) in grey levels; `edges` (N, 2) directions of the two edges
    that cross there, rad from u toward v, each known but for half a turn.
    """

    pixels: Array
    contrast: Array
    edges: Array

    def __len__(self) -> int:
        return len(self.pixels)

    def take(self, chosen: NDArray[np.intp]) -> "Candidates":
        """Return the candidates of the given indices."""
        return Candidates(self.pixels[chosen], self.contrast[chosen], self.edges[chosen])


def find_saddles(image: Grey, most: int = 80) -> Candidates:
    """Return at most `most` candidates of a grey picture (H, W), to a few tenths of a pixel.

    A large picture is searched at its own scale and at that of one 768 px wide, since marks may
    be large in it or small; one that shows few places also more coarsely, as it may be blurred.
    """
    levels = np.asarray(image, dtype=np.float32)
    wide = image.shape[1] / 768.0
    passes = [_at_scale(levels, scale) for scale in ((1.0, wide) if wide > 1.3 else (1.0,))]
    found = _joined(passes, most)
    if len(found) < min(FEW, most):
        coarse = _joined([_at_scale(levels, COARSER * max(1.0, wide))], most)
        # Where both see a mark the finer look is the better.
        away = np.linalg.norm(coarse.pixels[:, None] - found.pixels, axis=-1).min(
            axis=1, initial=np.inf
        )
        new = coarse.take(np.flatnonzero(away > NEW)[: most - len(found)])
        pairs = zip(vars(found).values(), vars(new).values(), strict=True)
        found = Candidates(*(np.concatenate(pair) for pair in pairs))
    return found


def _joined(passes: list[tuple[Array, Array, Array]], most: int) -> Candidates:
    """Return the candidates of several scales by falling contrast, each place once."""
    pixels, contrast, edges = (np.concatenate(columns) for columns in zip(*passes, strict=True))
    order = np.argsort(-contrast, kind="stable")
    chosen = order[_apart(pixels[order], 4.0)][:most]
    return Candidates(pixels[chosen], contrast[chosen], edges[chosen])


def _at_scale(levels: Levels, scale: float) -> tuple[Array, Array, Array]:
    """Return pixels (N, 2), contrast (N,) and edges (N, 2) of candidates of one size."""
    sigma = SMOOTHING * scale
    smooth = _smoothed(levels, sigma)
    places, contrast = _settled(smooth, *_proposals(smooth, sigma))
    if not len(places):
        return places, contrast, np.zeros((0, 2))
    passed, edges = _ring_check(_smoothed(levels, 0.7 * scale), places, contrast, scale)
    return places[passed], contrast[passed], edges[passed]


def _smoothed(levels: Levels, sigma: float) -> Levels:
    """Return the picture blurred by `sigma` px."""
    return np.asarray(cv2.GaussianBlur(levels, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE))


def _proposals(smooth: Levels, sigma: float) -> tuple[Array, Array]:
    """Return the strongest maxima (N, 2) of the saddle response and their contrast (N,)."""
    xx, yy, xy = _second_derivatives(smooth)
    response = xy * xy - xx * yy
    # For an upright checker of +-c grey levels the response is (2 c / (pi sigma^2))^2.
    contrast = np.sqrt(np.maximum(response, 0.0)) * np.float32(np.pi / 2.0 * sigma * sigma)
    peak = (contrast == cv2.dilate(contrast, np.ones((5, 5)))) & (contrast > LEAST_CONTRAST)
    rim = int(np.ceil(3 * sigma))
    peak[:rim] = peak[-rim:] = False
    peak[:, :rim] = peak[:, -rim:] = False
    v, u = np.nonzero(peak)
    order = np.argsort(-contrast[v, u], kind="stable")[:MOST_PROPOSALS]
    places = np.stack([u[order], v[order]], axis=-1).astype(float)
    return places, contrast[v[order], u[order]].astype(float)


def _second_derivatives(smooth: Levels) -> tuple[Levels, Levels, Levels]:
    """Return the derivatives uu, vv and uv of the picture by central differences."""
    u = np.array([[1.0, -2.0, 1.0]], dtype=np.float32)
    cross = np.array([[0.25, 0, -0.25], [0, 0, 0], [-0.25, 0, 0.25]], dtype=np.float32)
    uu, vv, uv = (
        np.asarray(
            cv2.filter2D(smooth, cv2.CV_32F, k, borderType=cv2.BORDER_REPLICATE), dtype=np.float32
        )
        for k in (u, u.T, cross)
    )
    return uu, vv, uv


def _settled(smooth: Levels, places: Array, contrast: Array) -> tuple[Array, Array]:
    """Return the places where the gradient vanishes, to a fraction of a pixel (Newton)."""
    at = places.copy()
    for _ in range(4):
        window = _samples(smooth, at[:, None, None] + _STENCIL)
        gu = (window[:, 1, 2] - window[:, 1, 0]) / 2.0
        gv = (window[:, 2, 1] - window[:, 0, 1]) / 2.0
        uu = window[:, 1, 2] - 2 * window[:, 1, 1] + window[:, 1, 0]
        vv = window[:, 2, 1] - 2 * window[:, 1, 1] + window[:, 0, 1]
        uv = (window[:, 2, 2] - window[:, 2, 0] - window[:, 0, 2] + window[:, 0, 0]) / 4.0
        det = np.minimum(uu * vv - uv * uv, -1e-6)
        step = np.stack([vv * gu - uv * gv, uu * gv - uv * gu], axis=-1) / det[:, None]
        at = at - np.clip(step, -1.0, 1.0)
    stayed = np.linalg.norm(at - places, axis=-1) < 3.0
    return at[stayed], contrast[stayed]


_STENCIL = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), axis=-1)


def _samples(levels: Levels, at: Array) -> Array:
    """Return bilinear samples (...) of the picture at pixels (..., 2)."""
    if not at.size:  # OpenCV takes no empty map
        return np.zeros(at.shape[:-1])
    flat = at.reshape(-1, 1, 2).astype(np.float32)
    x, y = np.ascontiguousarray(flat[..., 0]), np.ascontiguousarray(flat[..., 1])
    taken = cv2.remap(levels, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(taken, dtype=float).reshape(at.shape[:-1])


def _ring_check(
    fine: Levels, places: Array, contrast: Array, scale: float
) -> tuple[NDArray[np.bool_], Array]:
    """Say (N,) around which places four sectors alternate, and give the edges (N, 2) there."""
    spokes = np.arange(SPOKES) * (2.0 * np.pi / SPOKES)
    unit = np.stack([np.cos(spokes), np.sin(spokes)], axis=-1)
    centre = _samples(fine, places)
    passed = np.zeros(len(places), dtype=bool)
    edges = np.zeros((len(places), 2))
    for radius in RADII:
        ring = _samples(fine, places[:, None] + radius * scale * unit) - centre[:, None]
        good, found = _four_sectors(ring, np.maximum(0.35 * contrast, 4.0))
        edges[good] = found[good]
        passed |= good
    return passed, edges


def _four_sectors(ring: Array, least: Array) -> tuple[NDArray[np.bool_], Array]:
    """Say which rings (N, S) cross four sectors, each with a peak over `least` (N,).

    The two edge directions (N, 2) come from the places of the four changes of sign.
    """
    n, s = ring.shape
    bright = ring > 0.0
    changes = bright != np.roll(bright, -1, axis=1)
    alike = (bright == np.roll(bright, s // 2, axis=1)).mean(axis=1)
    good = (changes.sum(axis=1) == 4) & (alike > 0.7)
    edges = np.zeros((n, 2))
    for i in np.flatnonzero(good):
        k = np.flatnonzero(changes[i])
        after = ring[i, (k + 1) % s]
        turn = (k + ring[i, k] / (ring[i, k] - after)) * (2.0 * np.pi / s)
        sectors = np.split(np.abs(np.roll(ring[i], -k[0] - 1)), k[1:] - k[0])
        peaks = np.array([sector.max() for sector in sectors])
        good[i] = peaks.min() > least[i] and peaks.min() > 0.3 * peaks.max()
        # The two ends of one edge, halfway between them with half a turn taken off.
        halves = (turn[:2] + turn[2:] - np.pi) / 2.0
        good[i] &= bool(np.abs(turn[2:] - turn[:2] - np.pi).max() < np.radians(40.0))
        edges[i] = halves
    return good, edges


def _apart(places: Array, distance: float) -> NDArray[np.intp]:
    """Return the indices of places (N, 2) without those close to an earlier one."""
    kept: list[int] = []
    for i, place in enumerate(places):
        if all(np.linalg.norm(place - places[k]) > distance for k in kept):
            kept.append(i)
    return np.asarray(kept, dtype=np.intp)
