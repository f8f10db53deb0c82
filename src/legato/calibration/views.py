"""The camera's intrinsics from many views of the leg: one camera, a pose a view, one bundle.

A single view of this target leaves focal length and principal point all but unknown; ten share
them. Distortion k1, k2 joins in, and on request the marks' own places, which a hand pasted on.

How to lay the leg: the camera 80 to 90 mm from the big face's edge, before face and side at once
(in the leg's frame near (-25, -75, 55) mm), so that seven marks or more are seen, the leg runs away
from the camera, and it fills the picture. Aim by turns at 40, 60 and 85 mm along the leg, and
turn leg or camera a tenth of a turn about the line of sight from one picture to the next. Ten such
views at 0.25 px give alpha to 0.12 % and the principal point to 1 px (one X
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from legato.calibration.degeneracy import inspect
from legato.calibration.derivatives import place_derivative
from legato.calibration.hybrid import solve_hybrid
from legato.calibration.problem import (
    CalibrationError,
    EngineSettings,
    KnownIntrinsics,
    Problem,
    Solution,
)
from legato.calibration.solve import LEAST_KNOWN, check_data
from legato.calibration.uncertainty import noise_limit
from legato.geometry.projection import Intrinsics
from legato.geometry.transforms import Array, angle_between, rotation_from_vector, skew

LEAST_VIEWS = 10
SAME_RAD, SAME_MM = 0.01, 1.0  # views no farther apart tell the camera nothing new
ROUNDS = 100


@dataclass(frozen=True)
class CalibratedViews:
    """Intrinsics with covariance, and what they rest on.

    `residuals` holds (M_i, 2) px a view, predicted minus seen; `poses` (V, 4, 4) is
    camera_from_object; `rms_px` is over all coordinates and `view_rms_px` (V,) a view; `marks` are
    the marks' places (mm) as refined, or as given.
    """

    known: KnownIntrinsics
    rms_px: float
    view_rms_px: Array
    residuals: tuple[Array, ...]
    poses: Array
    marks: dict[str, Array]
    converged: bool


@dataclass(frozen=True)
class _Bundle:
    """All marks of all views in one list: view and mark index (K,), pixels (K, 2), sigma (K,)."""

    view: Array
    mark: Array
    pixels: Array
    sigma: Array
    given: Array  # (P, 3) marks as measured
    mark_sigma: float  # mm; zero keeps them

    def columns(self, views: int) -> int:
        """Return the number of unknowns: intrinsics, poses, marks."""
        return 6 + 6 * views + (self.given.size if self.mark_sigma > 0.0 else 0)


@dataclass(frozen=True)
class _State:
    """Where the bundle stands: intrinsics (6,), poses (V, 4, 4), marks (P, 3)."""

    lens: Array
    poses: Array
    marks: Array


def calibrate_views(
    views: Sequence[Problem],
    settings: EngineSettings,
    rng: np.random.Generator,
    mark_sigma: float = 0.0,
    least_views: int = LEAST_VIEWS,
) -> CalibratedViews:
    """Return the intrinsics that all views share.

    Each view is a Problem; what it holds of known intrinsics is not used. `mark_sigma` above zero
    (mm) lets the marks' places move about the given ones. Raises CalibrationError for too few or
    unusable views.
    """
    if len(views) < least_views:
        raise CalibrationError(
            f"{len(views)} {'view is' if len(views) == 1 else 'views are'} too few",
            f"take at least {least_views}, from all around",
        )
    views = [replace(v, known=None) for v in views]
    for number, view in enumerate(views, start=1):
        _check_view(view, number, views[0].size)
    names = sorted({n for v in views for n in v.names})
    bundle = _gather(views, names, mark_sigma)
    start = _first_guess(views, settings, rng)
    state = _State(start[0], start[1], bundle.given)
    state, information, converged = _adjust(bundle, state)
    return _report(views, names, bundle, state, information, converged)


def repeats(poses: Array) -> dict[int, int]:
    """Return the views (V, 4, 4) that show the leg as an earlier one does, each with that one."""
    found: dict[int, int] = {}
    for later in range(len(poses)):
        for earlier in range(later):
            apart = np.linalg.norm(poses[later, :3, 3] - poses[earlier, :3, 3])
            turn = angle_between(poses[later, :3, :3], poses[earlier, :3, :3])
            if earlier not in found and apart < SAME_MM and turn < SAME_RAD:
                found[later] = earlier
                break
    return found


def _check_view(view: Problem, number: int, size: tuple[int, int]) -> None:
    """Raise CalibrationError, naming the view, where it cannot take part."""
    try:
        check_data(view)
    except CalibrationError as error:
        raise CalibrationError(f"view {number}: {error.text}", error.hint) from error
    if len(view.names) < LEAST_KNOWN:
        raise CalibrationError(
            f"view {number} has {len(view.names)} marks", f"find at least {LEAST_KNOWN}"
        )
    if view.size != size:
        raise CalibrationError(
            f"view {number} is {view.size[0]}x{view.size[1]} px, the first {size[0]}x{size[1]}",
            "take all views with one camera in one mode",
        )


def _gather(views: Sequence[Problem], names: list[str], mark_sigma: float) -> _Bundle:
    """Return all marks of all views in one list."""
    place = {n: p for v in views for n, p in zip(v.names, v.points, strict=True)}
    return _Bundle(
        view=np.concatenate([np.full(len(v.names), i) for i, v in enumerate(views)]),
        mark=np.array([names.index(n) for v in views for n in v.names]),
        pixels=np.concatenate([v.pixels for v in views]),
        sigma=np.concatenate([v.sigma for v in views]),
        given=np.array([place[n] for n in names]),
        mark_sigma=mark_sigma,
    )


def _first_guess(
    views: Sequence[Problem], settings: EngineSettings, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return intrinsics (6,), the weighted mean of single views, and each view's pose with them."""
    sound = [v for v in views if len(v.names) >= 7 and not inspect(v).refused]
    if not sound:
        raise CalibrationError(
            "no view has seven marks off one plane", "show both the face and the side"
        )
    single: list[Solution] = [solve_hybrid(v, settings, rng) for v in sound]
    total, pulled = np.zeros((4, 4)), np.zeros(4)
    for s in single:
        i = s.intrinsics
        information = np.linalg.inv(s.covariance[:4, :4])
        total += information
        pulled += information @ [i.alpha_u, i.alpha_v, i.u0, i.v0]
    mean = np.linalg.solve(total, pulled)
    camera = KnownIntrinsics(_camera([*mean, 0.0, 0.0], views[0].size))
    poses = [
        solve_hybrid(replace(v, known=camera), settings, rng).camera_from_object for v in views
    ]
    return np.concatenate([mean, np.zeros(2)]), np.array(poses)


def _camera(lens: Sequence[float], size: tuple[int, int]) -> Intrinsics:
    """Return the camera of alpha_u, alpha_v, u0, v0, k1, k2 and a picture size."""
    alpha_u, alpha_v, u0, v0, k1, k2 = lens
    return Intrinsics(alpha_u, alpha_v, u0, v0, k1, k2, *size)


def _adjust(bundle: _Bundle, state: _State) -> tuple[_State, Array, bool]:
    """Return the bundle's optimum by Levenberg-Marquardt, and the information matrix there."""
    r, j = _linearise(bundle, state)
    value, damping = float(r @ r), 1e-3
    for _ in range(ROUNDS):
        hessian, gradient = j.T @ j, j.T @ r
        scale = 1.0 / np.sqrt(np.maximum(np.diag(hessian), 1e-300))
        scaled = hessian * np.outer(scale, scale) + damping * np.eye(len(scale))
        step = -np.linalg.solve(scaled, gradient * scale) * scale
        decrease = -float(step @ (2.0 * gradient + hessian @ step))
        if decrease <= 1e-12 * value + 1e-20 and damping <= 1e-2:
            return state, hessian, True
        trial = _moved(bundle, state, step)
        trial_r, trial_j = _linearise(bundle, trial)
        trial_value = float(trial_r @ trial_r)
        if np.isfinite(trial_value) and trial_value <= value:
            state, r, j, value = trial, trial_r, trial_j, trial_value
            damping = max(damping * 0.1, 1e-12)
        elif damping > 1e12:
            break
        else:
            damping *= 8.0
    return state, j.T @ j, False


def _moved(bundle: _Bundle, state: _State, step: Array) -> _State:
    """Return the state after a step of all unknowns; rotations turn from the left."""
    v = len(state.poses)
    poses = state.poses.copy()
    turn = step[6 : 6 + 6 * v].reshape(v, 6)
    poses[:, :3, :3] = rotation_from_vector(turn[:, :3]) @ poses[:, :3, :3]
    poses[:, :3, 3] += turn[:, 3:]
    marks = state.marks
    if bundle.mark_sigma > 0.0:
        marks = marks + step[6 + 6 * v :].reshape(-1, 3)
    return _State(state.lens + step[:6], poses, marks)


def _linearise(bundle: _Bundle, state: _State) -> tuple[Array, Array]:
    """Return residuals in sigmas and their derivatives; infinite where a mark is behind."""
    k, v = len(bundle.view), len(state.poses)
    turns = state.poses[bundle.view, :3, :3]
    turned = (turns @ state.marks[bundle.mark][..., None])[..., 0]
    c = turned + state.poses[bundle.view, :3, 3]
    if (c[:, 2] <= 0.0).any():
        return np.array([np.inf]), np.zeros((1, bundle.columns(v)))
    alpha_u, alpha_v, u0, v0, k1, k2 = state.lens
    x, y, alphas = c[:, 0] / c[:, 2], c[:, 1] / c[:, 2], np.array([alpha_u, alpha_v])
    n = np.stack([x, y], axis=1)
    r2 = np.sum(n * n, axis=1, keepdims=True)
    grow = 1.0 + r2 * (k1 + r2 * k2)
    rows = np.arange(k)
    j = np.zeros((k, 2, bundle.columns(v)))
    j[:, 0, 0], j[:, 1, 1] = (n * grow).T
    j[:, 0, 2] = j[:, 1, 3] = 1.0
    j[:, :, 4], j[:, :, 5] = n * alphas * r2, n * alphas * r2**2
    # d distorted / d undistorted, then d undistorted / d place.
    inner = grow[:, :, None] * np.eye(2) + (2.0 * (k1 + 2.0 * k2 * r2))[:, :, None] * (
        n[:, :, None] * n[:, None, :]
    )
    by_place = alphas[:, None] * (inner @ place_derivative(np.ones(k), np.ones(k), x, y, c[:, 2]))
    first = 6 + 6 * bundle.view
    for axis in range(3):
        j[rows, :, first + axis] = -(by_place @ skew(turned))[:, :, axis]
        j[rows, :, first + 3 + axis] = by_place[:, :, axis]
    r = (n * grow * alphas + [u0, v0] - bundle.pixels) / bundle.sigma[:, None]
    if bundle.mark_sigma > 0.0:
        by_mark = by_place @ turns
        for axis in range(3):
            j[rows, :, 6 + 6 * v + 3 * bundle.mark + axis] = by_mark[:, :, axis]
    j /= bundle.sigma[:, None, None]
    r, rows_j = r.reshape(-1), j.reshape(2 * k, -1)
    if bundle.mark_sigma > 0.0:
        pasted = np.zeros((bundle.given.size, bundle.columns(v)))
        pasted[:, 6 + 6 * v :] = np.eye(bundle.given.size) / bundle.mark_sigma
        r = np.concatenate([r, (state.marks - bundle.given).reshape(-1) / bundle.mark_sigma])
        rows_j = np.concatenate([rows_j, pasted])
    return r, rows_j


def _report(
    views: Sequence[Problem],
    names: list[str],
    bundle: _Bundle,
    state: _State,
    information: Array,
    converged: bool,
) -> CalibratedViews:
    """Return the result; its covariance grows with a misfit beyond the noise."""
    r, _ = _linearise(bundle, state)
    chi_square = float(r @ r)
    freedom = 2 * len(bundle.view) - 6 - 6 * len(views)
    grow = max(1.0, chi_square / freedom) if chi_square > noise_limit(freedom) else 1.0
    scale = 1.0 / np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    covariance = inverse[:6, :6] * grow
    camera = _camera([float(x) for x in state.lens], views[0].size)
    off = r[: 2 * len(bundle.view)].reshape(-1, 2) * bundle.sigma[:, None]
    parts = tuple(off[bundle.view == i] for i in range(len(views)))
    return CalibratedViews(
        known=KnownIntrinsics(camera, (covariance + covariance.T) / 2.0),
        rms_px=float(np.sqrt(np.mean(off**2))),
        view_rms_px=np.array([np.sqrt(np.mean(p**2)) for p in parts]),
        residuals=parts,
        poses=state.poses,
        marks=dict(zip(names, state.marks, strict=True)),
        converged=converged,
    )
