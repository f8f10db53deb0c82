"""A picture's view: where camera and leg stand, as far as labels and templates need to know.

The nominal intrinsics may be wrong, so the fit moves them too, held by a prior. This pose only
predicts where marks lie and how they look; the pose that an arm follows is calibration's.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import ArrayLike

from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, project
from legato.geometry.raycast import facing
from legato.geometry.transforms import Array

SIGMA_ALPHA = 0.06  # of alpha
SIGMA_ASPECT = 0.01  # of alpha_v / alpha_u
SIGMA_CENTRE = 12.0  # px at a picture width of 768
SMALLEST_FACING = 0.12  # cosine under which a mark is too oblique to be measured


@dataclass(frozen=True)
class View:
    """Intrinsics and camera_from_object (4x4) that explain a picture's marks."""

    intrinsics: Intrinsics
    camera_from_object: Array

    def pixels(self, points: ArrayLike) -> Array:
        """Return the pixels (N, 2) of object points (N, 3), NaN behind the camera."""
        return project(self.intrinsics, self.camera_from_object, points)

    def unseen(self, leg: Leg, margin: float) -> dict[str, str]:
        """Return, for each mark that cannot be in sight, the reason."""
        found = {}
        for name, pixel in zip(leg.names(), self.pixels(leg.points()), strict=True):
            if facing(leg, name, self.camera_from_object) < SMALLEST_FACING:
                found[name] = "faces away from the camera"
            elif not self.intrinsics.sees(pixel, margin):
                found[name] = "outside the picture"
        return found


def fit_view(
    start: View, nominal: Intrinsics, points: Array, pixels: Array, sigma: ArrayLike, rounds: int
) -> tuple[View, Array]:
    """Return the view nearest to marks seen at `pixels` (M, 2), and the misfits (M, 2) in px.

    `points` (M, 3) are in the object frame, `sigma` a number or (M,) px. Levenberg-Marquardt over
    rotation, translation, alpha, aspect and principal point, the last four held to `nominal`.
    """
    weight = 1.0 / np.broadcast_to(np.asarray(sigma, dtype=float), pixels.shape[:1])
    view, damping = start, 1e-4
    cost, residual = _cost(view, nominal, points, pixels, weight)
    for _ in range(rounds):
        jacobian = _jacobian(view, nominal, points, weight)
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ residual
        damped = normal + damping * np.diag(np.diag(normal))
        try:
            step = np.asarray(np.linalg.solve(damped, -gradient), dtype=float)
        except np.linalg.LinAlgError:
            break
        trial = _moved(view, nominal, step)
        new_cost, new_residual = _cost(trial, nominal, points, pixels, weight)
        if new_cost < cost:
            small = cost - new_cost < 1e-6 * cost + 1e-9
            view, cost, residual, damping = trial, new_cost, new_residual, damping * 0.1
            if small:
                break
        else:
            damping *= 10.0
            if damping > 1e6:
                break
    return view, view.pixels(points) - pixels


def _cost(
    view: View, nominal: Intrinsics, points: Array, pixels: Array, weight: Array
) -> tuple[float, Array]:
    """Return the sum of squares and the weighted residuals, prior included."""
    misfit = (view.pixels(points) - pixels) * weight[:, None]
    residual = np.concatenate([misfit.ravel(), _prior(view.intrinsics, nominal)])
    residual = np.where(np.isfinite(residual), residual, 1e6)
    return float(residual @ residual), residual


def _prior(now: Intrinsics, nominal: Intrinsics) -> Array:
    """Return how far the intrinsics left the nominal ones, in standard deviations (4,)."""
    centre = SIGMA_CENTRE * max(1.0, nominal.width / 768.0)
    u, v = np.log(now.alpha_u / nominal.alpha_u), np.log(now.alpha_v / nominal.alpha_v)
    return np.array(
        [
            (u + v) / 2.0 / SIGMA_ALPHA,
            (v - u) / SIGMA_ASPECT,
            (now.u0 - nominal.u0) / centre,
            (now.v0 - nominal.v0) / centre,
        ]
    )


def _jacobian(view: View, nominal: Intrinsics, points: Array, weight: Array) -> Array:
    """Return d residual / d (rotation, translation, log alpha, log aspect, u0, v0)."""
    i, pose = view.intrinsics, view.camera_from_object
    x, y, z = pose[:3, :3] @ points.T
    tx, ty, tz = pose[:3, 3]
    depth = np.maximum(z + tz, 1e-3)
    n = np.stack([(x + tx) / depth, (y + ty) / depth])
    r2 = n[0] * n[0] + n[1] * n[1]
    # Radial terms enter through the local scale only: enough for a step to go downhill.
    scale = (1.0 + r2 * (i.k1 + r2 * i.k2)) * weight
    whole = np.zeros((2 * len(points) + 4, 10))
    jacobian = whole[:-4].reshape(len(points), 2, 10)
    for k, alpha in enumerate((i.alpha_u, i.alpha_v)):
        a = scale * alpha / depth
        b = -a * n[k]
        # The derivative by the place (a, 0, b) or (0, a, b); by the turn, the arm crossed with it.
        px, py = (a, 0.0) if k == 0 else (0.0, a)
        for column, value in enumerate((y * b - z * py, z * px - x * b, x * py - y * px)):
            jacobian[:, k, column] = value
        jacobian[:, k, 3 + k], jacobian[:, k, 5] = a, b
        arm = scale * alpha * n[k]
        jacobian[:, k, 6], jacobian[:, k, 7] = arm, (k - 0.5) * arm
        jacobian[:, k, 8 + k] = weight
    centre = SIGMA_CENTRE * max(1.0, nominal.width / 768.0)
    whole[-4:, 6:] = np.diag([1 / SIGMA_ALPHA, 1 / SIGMA_ASPECT, 1 / centre, 1 / centre])
    return whole


def _moved(view: View, nominal: Intrinsics, step: Array) -> View:
    """Return the view after a step of `_jacobian`'s ten parameters."""
    i, pose = view.intrinsics, view.camera_from_object
    scale, aspect = np.exp(np.clip(step[6:8], -0.3, 0.3))
    centre = step[8:10] + np.array([i.u0, i.v0])
    low = np.array([0.0, 0.0])
    high = np.array([nominal.width, nominal.height], dtype=float)
    u0, v0 = np.clip(centre, low, high)
    moved = replace(
        i,
        alpha_u=float(i.alpha_u * scale / np.sqrt(aspect)),
        alpha_v=float(i.alpha_v * scale * np.sqrt(aspect)),
        u0=float(u0),
        v0=float(v0),
    )
    after = pose.copy()
    after[:3, :3] = cv2.Rodrigues(np.clip(step[:3], -0.5, 0.5))[0] @ pose[:3, :3]
    after[:3, 3] += step[3:6]
    return View(moved, after)
