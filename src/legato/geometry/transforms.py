"""Rigid transforms as 4x4 matrices named `to_from_of`: `world_from_object @ point_object`.

Every function is vectorised over leading axes unless it says otherwise.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class NotARotation(ValueError):
    """A matrix that was given as a rigid transform is none."""

    def __init__(self, determinant: float, error: float) -> None:
        self.determinant = determinant
        self.error = error
        super().__init__(
            f"not a rotation: determinant {determinant:.4f} (expected 1), "
            f"largest element of R^T R - I {error:.2e} (expected below tolerance)"
        )


def rotation_from_angles(angles: ArrayLike) -> Array:
    """Return Rx(omega) Ry(phi) Rz(kappa), object to camera (paper section 3, r11 corrected).

    `angles` is (..., 3) in rad: omega, phi, kappa. The result is (..., 3, 3).
    """
    angles = np.asarray(angles, dtype=float)
    sines, cosines = np.sin(angles), np.cos(angles)
    so, sp, sk = sines[..., 0], sines[..., 1], sines[..., 2]
    co, cp, ck = cosines[..., 0], cosines[..., 1], cosines[..., 2]
    out = np.empty((*angles.shape, 3))  # filled in place: the searches call this thousands of times
    out[..., 0, 0], out[..., 0, 1], out[..., 0, 2] = cp * ck, -cp * sk, sp
    out[..., 1, 0] = so * sp * ck + co * sk
    out[..., 1, 1] = -so * sp * sk + co * ck
    out[..., 1, 2] = -so * cp
    out[..., 2, 0] = -co * sp * ck + so * sk
    out[..., 2, 1] = co * sp * sk + so * ck
    out[..., 2, 2] = co * cp
    return out


def angles_from_rotation(rotation: ArrayLike) -> Array:
    """Return omega, phi, kappa in rad, (..., 3), of rotations (..., 3, 3); phi in [-pi/2, pi/2]."""
    r = np.asarray(rotation, dtype=float)
    phi = np.arcsin(np.clip(r[..., 0, 2], -1.0, 1.0))
    omega = np.arctan2(-r[..., 1, 2], r[..., 2, 2])
    kappa = np.arctan2(-r[..., 0, 1], r[..., 0, 0])
    return np.stack([omega, phi, kappa], axis=-1)


def rotation_from_vector(vector: ArrayLike) -> Array:
    """Return the rotation (..., 3, 3) about `vector` (..., 3) by its length in rad (Rodrigues)."""
    v = np.asarray(vector, dtype=float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    safe = np.where(angle > 1e-12, angle, 1.0)
    k = skew(v) / safe
    series = np.eye(3) + skew(v)
    exact = np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)
    return np.where(angle > 1e-12, exact, series)


def skew(vector: ArrayLike) -> Array:
    """Return the matrix (..., 3, 3) whose product with x is `vector` cross x."""
    v = np.asarray(vector, dtype=float)
    x, y, z = np.moveaxis(v, -1, 0)
    o = np.zeros_like(x)
    rows = [[o, -z, y], [z, o, -x], [-y, x, o]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def transform(rotation: ArrayLike, translation: ArrayLike) -> Array:
    """Return transforms (..., 4, 4) of rotations (..., 3, 3) and translations (..., 3) in mm."""
    r = np.asarray(rotation, dtype=float)
    t = np.asarray(translation, dtype=float)
    out = np.zeros((*np.broadcast_shapes(r.shape[:-2], t.shape[:-1]), 4, 4))
    out[..., :3, :3] = r
    out[..., :3, 3] = t
    out[..., 3, 3] = 1.0
    return out


def invert(matrix: ArrayLike) -> Array:
    """Return the inverse of rigid transforms (..., 4, 4)."""
    m = np.asarray(matrix, dtype=float)
    r = np.swapaxes(m[..., :3, :3], -1, -2)
    return transform(r, -(r @ m[..., :3, 3:])[..., 0])


def apply(matrix: ArrayLike, points: ArrayLike) -> Array:
    """Return points (..., N, 3) carried by transforms (..., 4, 4)."""
    m = np.asarray(matrix, dtype=float)
    p = np.asarray(points, dtype=float)
    return np.asarray(p @ np.swapaxes(m[..., :3, :3], -1, -2) + m[..., None, :3, 3])


def nearest_rotation(matrix: ArrayLike) -> Array:
    """Return the rotation (3, 3) nearest to a 3x3 matrix in the Frobenius norm."""
    u, _, vt = np.linalg.svd(np.asarray(matrix, dtype=float))
    return np.asarray(u @ np.diag([1.0, 1.0, float(np.linalg.det(u @ vt))]) @ vt)


def checked_transform(matrix: ArrayLike, tolerance: float = 1e-6) -> Array:
    """Return one 4x4 matrix as a rigid transform.

    Raises NotARotation with determinant and error where the rotation part is off by more than
    `tolerance`, and ValueError for a wrong shape, a value that is not finite or a wrong last row.
    """
    m = np.asarray(matrix, dtype=float)
    if m.shape != (4, 4):
        raise ValueError(f"a transform is a 4x4 matrix, not {'x'.join(map(str, m.shape))}")
    if not np.isfinite(m).all():
        raise ValueError("a transform's elements are finite numbers")
    if not np.array_equal(m[3], [0.0, 0.0, 0.0, 1.0]):
        raise ValueError(f"the last row of a transform is 0 0 0 1, not {m[3].tolist()}")
    r = m[:3, :3]
    determinant = float(np.linalg.det(r))
    error = float(np.abs(r.T @ r - np.eye(3)).max())
    if error > tolerance or abs(determinant - 1.0) > tolerance:
        raise NotARotation(determinant, error)
    return m


def look_at(eye: ArrayLike, target: ArrayLike) -> Array:
    """Return world_from_camera (4x4) of a camera at `eye` aimed at `target`, its x axis level.

    Camera axes are OpenCV's: x right, y down, z forward; the world's z is up. Raises ValueError
    where the camera would look straight up or down, or eye and target coincide.
    """
    eye = np.asarray(eye, dtype=float)
    forward = np.asarray(target, dtype=float) - eye
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) < 1e-9 * max(1.0, float(np.linalg.norm(forward))):
        raise ValueError("camera and target need a horizontal distance; give the full matrix")
    forward = forward / np.linalg.norm(forward)
    right = right / np.linalg.norm(right)
    return transform(np.stack([right, np.cross(forward, right), forward], axis=-1), eye)


def angle_between(a: ArrayLike, b: ArrayLike) -> Array:
    """Return angles (...) between rotations (..., 3, 3), accurate for small ones too."""
    d = np.swapaxes(np.asarray(a, dtype=float), -1, -2) @ np.asarray(b, dtype=float)
    chord = np.linalg.norm(d - np.eye(3), axis=(-2, -1)) / (2.0 * np.sqrt(2.0))
    return np.asarray(2.0 * np.arcsin(np.clip(chord, 0.0, 1.0)))
