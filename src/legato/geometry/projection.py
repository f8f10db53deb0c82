"""The camera: pinhole with two radial distortion terms, in OpenCV's conventions.

Image coordinates are (u right, v down) in px with pixel centres at whole numbers; the camera frame
has x right, y down, z forward.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from legato.geometry.transforms import Array, apply


@dataclass(frozen=True)
class Intrinsics:
    """What belongs to the camera alone; alpha_u = f s_x and alpha_v = f s_y in px."""

    alpha_u: float
    alpha_v: float
    u0: float
    v0: float
    k1: float = 0.0
    k2: float = 0.0
    width: int = 768
    height: int = 576

    def matrix(self) -> Array:
        """Return the 3x3 camera matrix."""
        return np.array(
            [[self.alpha_u, 0.0, self.u0], [0.0, self.alpha_v, self.v0], [0.0, 0.0, 1.0]]
        )

    def sees(self, pixels: ArrayLike, margin: float = 0.0) -> Array:
        """Say (...) which pixels (..., 2) lie in the picture, `margin` px from its edge."""
        p = np.asarray(pixels, dtype=float)
        u, v = p[..., 0], p[..., 1]
        inside = (u >= margin) & (u <= self.width - 1 - margin)
        return np.asarray(inside & (v >= margin) & (v <= self.height - 1 - margin))


def distort(intrinsics: Intrinsics, normalised: ArrayLike) -> Array:
    """Return pixels (..., 2) of undistorted normalised coordinates (..., 2)."""
    n = np.asarray(normalised, dtype=float)
    r2 = np.sum(n * n, axis=-1, keepdims=True)
    d = n * (1.0 + r2 * (intrinsics.k1 + r2 * intrinsics.k2))
    return np.asarray(d * [intrinsics.alpha_u, intrinsics.alpha_v] + [intrinsics.u0, intrinsics.v0])


def undistort(intrinsics: Intrinsics, pixels: ArrayLike) -> Array:
    """Return undistorted normalised coordinates (..., 2) of pixels (..., 2), by fixed point."""
    p = np.asarray(pixels, dtype=float)
    d = (p - [intrinsics.u0, intrinsics.v0]) / [intrinsics.alpha_u, intrinsics.alpha_v]
    if not (intrinsics.k1 or intrinsics.k2):
        return d
    # Only the radius is distorted: iterate on the factor that carries d to n.
    seen2 = d[..., 0] * d[..., 0] + d[..., 1] * d[..., 1]
    factor = np.ones_like(seen2)
    for _ in range(30):
        r2 = seen2 * factor * factor
        moved = 1.0 / (1.0 + r2 * (intrinsics.k1 + r2 * intrinsics.k2))
        settled = np.abs(moved - factor).max(initial=0.0) < 1e-15
        factor = moved
        if settled:
            break
    return np.asarray(d * factor[..., None])


def pinhole_pixels(intrinsics: Intrinsics, pixels: ArrayLike) -> Array:
    """Return where pixels (..., 2) would lie if the lens had no distortion."""
    n = undistort(intrinsics, pixels)
    return n * [intrinsics.alpha_u, intrinsics.alpha_v] + [intrinsics.u0, intrinsics.v0]


def project(intrinsics: Intrinsics, camera_from_object: ArrayLike, points: ArrayLike) -> Array:
    """Return pixels (..., N, 2) of object points (..., N, 3); NaN where a point is not in front."""
    c = apply(camera_from_object, points)
    depth = np.where(c[..., 2:] > 0.0, c[..., 2:], np.nan)
    return distort(intrinsics, c[..., :2] / depth)


def rays(intrinsics: Intrinsics, pixels: ArrayLike) -> Array:
    """Return unit directions (..., 3) in the camera frame of pixels (..., 2)."""
    n = undistort(intrinsics, pixels)
    d = np.concatenate([n, np.ones_like(n[..., :1])], axis=-1)
    return np.asarray(d / np.linalg.norm(d, axis=-1, keepdims=True))
