"""One mark as it should look: its checker ray-cast at a view, on a grid finer than the pixels.

Curvature, obliquity and lens distortion come from the view; shift, turn and blur may change
without another ray being cast.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from legato.geometry.leg import Leg
from legato.geometry.projection import undistort
from legato.geometry.raycast import BIG_FACE, SIDE, object_rays, points_on
from legato.geometry.transforms import Array
from legato.vision.view import View

PAD = 6  # px around the mark's outline
LARGEST_PATCH = 160  # px; larger marks are measured in their middle
BLUR_STEP = 0.1  # relative
FAR = 1e3  # mm beside a mark: no pattern is there


Plane = NDArray[np.float32]


@dataclass(frozen=True)
class Template:
    """A mark's patch of `shape` (h, w) px whose first pixel is `corner` (u, v).

    Each pixel has `fine` x `fine` rays. `along` and `around` (h n, w n) are their developed
    coordinates on the mark, FAR beside its surface, which `surface` tells by 0; `slopes` are the
    derivatives of both to the fine grid's columns and rows: along by column, along by row, around
    by column, around by row. `half` is half the mark's side.
    """

    corner: tuple[int, int]
    shape: tuple[int, int]
    fine: int
    half: float
    along: Plane
    around: Plane
    surface: Plane
    slopes: tuple[Plane, Plane, Plane, Plane]

    def scaled(self, by: float) -> "Template":
        """Return the template of a mark so many times as large."""
        return replace(self, half=self.half * by)

    def pattern(self, shift: Array, turn: float) -> tuple[Plane, Plane]:
        """Return the sharp checker in [-1, 1] and the coverage by paper in [0, 1], fine grid.

        `shift` (2,) px moves the mark in the picture: the coordinates are linear enough over a
        few pixels, and no sample is interpolated.
        """
        c, s = np.float32(np.cos(turn)), np.float32(np.sin(turn))
        du, dv = (np.float32(x * self.fine) for x in shift)
        au, av, bu, bv = self.slopes
        along = self.along - (du * au + dv * av)
        around = self.around - (du * bu + dv * bv)
        first = self._edge(c * along + s * around, c * au + s * bu, c * av + s * bv)
        second = self._edge(c * around - s * along, c * bu - s * au, c * bv - s * av)
        inside = first[1] * second[1]
        return first[0] * second[0] * inside, inside

    def _edge(self, own: Plane, by_column: Plane, by_row: Plane) -> tuple[Plane, Plane]:
        """Return the side of the middle line, -1 to 1, and the coverage along one coordinate."""
        per_mm = 1.0 / np.sqrt(by_column * by_column + by_row * by_row)
        side = np.minimum(np.maximum(2.0 * own * per_mm, -1.0), 1.0)
        cover = np.minimum(np.maximum(0.5 + (self.half - np.abs(own)) * per_mm, 0.0), 1.0)
        return side, cover

    def seen(self, sharp: Plane, blur: float) -> Plane:
        """Return a fine pattern as pixels (h, w) after the lens's blur (px) and their own area."""
        n = self.fine
        soft = cv2.GaussianBlur(sharp, (0, 0), blur * n, borderType=cv2.BORDER_REPLICATE)
        if n > 1:
            soft = cv2.blur(soft, (n, n), borderType=cv2.BORDER_REPLICATE)
        return np.asarray(soft[n // 2 :: n, n // 2 :: n])


def make_template(leg: Leg, view: View, name: str, fine: int) -> Template | None:
    """Return the template of a mark at a view, with `fine` (odd) rays along a pixel.

    None where the mark does not lie in the picture.
    """
    i = view.intrinsics
    half = leg.mark_size / 2.0
    span = np.linspace(-half, half, 5)
    square = np.stack(np.meshgrid(span, span), axis=-1).reshape(-1, 2)
    outline = view.pixels(leg.mark_surface(name, square * 1.15))
    centre = view.pixels(leg.points((name,)))[0]
    if not np.isfinite(outline).all() or not i.sees(centre, 3.0):
        return None
    low = np.maximum(outline.min(axis=0) - PAD, centre - LARGEST_PATCH / 2)
    high = np.minimum(outline.max(axis=0) + PAD, centre + LARGEST_PATCH / 2)
    u0, v0 = (int(x) for x in np.maximum(np.floor(low), 0))
    u1 = min(int(np.ceil(high[0])), i.width - 1)
    v1 = min(int(np.ceil(high[1])), i.height - 1)
    w, h = u1 - u0 + 1, v1 - v0 + 1
    if w < 8 or h < 8:
        return None
    along, around = _developed(leg, view, name, (u0, v0), (h, w), fine)
    slopes = [difference(x, axis) for x in (along, around) for axis in (1, 0)]
    off = ~np.isfinite(along + sum(slopes))
    for plane, value in zip((along, around, *slopes), (FAR, FAR, 1.0, 0.0, 0.0, 1.0), strict=True):
        plane[off] = value
    surface = np.where(off, np.float32(0.0), np.float32(1.0))
    au, av, bu, bv = slopes
    return Template((u0, v0), (h, w), fine, half, along, around, surface, (au, av, bu, bv))


def difference(plane: Plane, axis: int) -> Plane:
    """Return the central difference along an axis, one-sided at the ends."""
    out = np.empty_like(plane)
    p, q = (plane, out) if axis == 0 else (plane.T, out.T)
    q[1:-1] = (p[2:] - p[:-2]) * np.float32(0.5)
    q[0], q[-1] = p[1] - p[0], p[-1] - p[-2]
    return out


def _developed(
    leg: Leg, view: View, name: str, corner: tuple[int, int], shape: tuple[int, int], fine: int
) -> tuple[Plane, Plane]:
    """Return the developed coordinates of a patch's fine rays, NaN beside the mark's surface."""
    offset = (np.arange(fine) + 0.5) / fine - 0.5
    u = (corner[0] + np.arange(shape[1])[:, None] + offset).ravel()
    v = (corner[1] + np.arange(shape[0])[:, None] + offset).ravel()
    pixels = np.stack(np.meshgrid(u, v), axis=-1)
    normalised = undistort(view.intrinsics, pixels)
    part = BIG_FACE if leg.on_face(name) else SIDE
    points = points_on(leg, part, *object_rays(view.camera_from_object, normalised))
    flat = leg.mark_coordinates(name, points).astype(np.float32)
    return np.ascontiguousarray(flat[..., 0]), np.ascontiguousarray(flat[..., 1])
