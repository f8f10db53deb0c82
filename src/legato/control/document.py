"""A calibration as the JSON document of `legato solve` and of a record's calibration.json."""

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

import numpy as np

from legato.calibration.problem import GENES, Solution
from legato.control.advice import Advice, advise
from legato.control.checks import Check, picture_checks
from legato.control.perceive import Calibration
from legato.control.settings import CellSettings
from legato.geometry.projection import project
from legato.geometry.transforms import (
    Array,
    angles_from_rotation,
    rotation_from_angles,
    rotation_from_vector,
)

NOT_SEPARABLE = "f, s_x and s_y are not separately observable: only alpha_u and alpha_v are"


def document(
    calibration: Calibration, settings: CellSettings, checks: Iterable[Check] | None = None
) -> dict[str, Any]:
    """Return the document; without `checks` those that the picture alone can answer are made."""
    checks = picture_checks(calibration, settings) if checks is None else list(checks)
    solution, problem = calibration.solution, calibration.problem
    camera = solution.intrinsics
    marks = {n: calibration.picking.marks[n] for n in _shown(calibration, settings)}
    return {
        "accepted": all(c.ok for c in checks),
        "reasons": [c.text for c in checks if not c.ok],
        "engine": solution.engine,
        "intrinsics": "free" if problem.known is None else "known",
        "marks": {n: [m.u, m.v] for n, m in marks.items()},
        "missing": dict(calibration.picking.missing),
        "left_out": list(calibration.left_out),
        "residuals": residuals_told(calibration, settings),
        "rms_px": solution.rms_px,
        "camera_from_object": solution.camera_from_object.tolist(),
        "world_from_object": calibration.world_from_object.tolist(),
        "world_from_camera": settings.world_from_camera.tolist(),
        "alpha_u": camera.alpha_u,
        "alpha_v": camera.alpha_v,
        "u0": camera.u0,
        "v0": camera.v0,
        "k1": camera.k1,
        "k2": camera.k2,
        "width": settings.nominal.width,
        "height": settings.nominal.height,
        "parameters": _parameters(calibration),
        "sigma": {
            "rotation_deg": float(np.degrees(solution.sigma_rotation)),
            "translation_mm": solution.sigma_translation,
            "stations_mm": solution.sigma_stations.tolist(),
        },
        "agreement": solution.agreement,
        "held_out": [asdict(h) for h in calibration.held_out],
        "suspects": list(calibration.suspects.names),
        "suggest": suggestion(advise(calibration, settings)),
        "warnings": _warnings(calibration),
        "trace": {"best": list(solution.trace.best), "mean": list(solution.trace.mean)},
        "generations": solution.generations,
        "stopped_by": solution.stopped_by,
        "checks": [asdict(c) for c in checks],
        "stations": _stations(calibration, settings),
        "leg": {
            "big_radius_mm": settings.leg.big_radius,
            "small_radius_mm": settings.leg.small_radius,
            "length_mm": settings.leg.length,
            "marks": {n: list(p) for n, p in settings.leg.marks.items()},
        },
    }


def suggestion(advice: Advice) -> dict[str, Any]:
    """Return the document's key `suggest`: marks to use, marks to add, and why."""
    return {"use": list(advice.use), "add": list(advice.add), "why": advice.why}


def _shown(calibration: Calibration, settings: CellSettings) -> list[str]:
    """Return the marks used and those left out, in the leg's order."""
    used = {*calibration.problem.names, *calibration.left_out}
    return [n for n in settings.leg.names() if n in used]


def residuals_told(calibration: Calibration, settings: CellSettings) -> dict[str, list[float]]:
    """Return predicted minus seen in px, for the marks left out too."""
    names = _shown(calibration, settings)
    solution, marks = calibration.solution, calibration.picking.marks
    points = settings.leg.points(tuple(names))
    predicted = project(solution.intrinsics, solution.camera_from_object, points)
    return {
        n: [float(p[0] - marks[n].u), float(p[1] - marks[n].v)]
        for n, p in zip(names, predicted, strict=True)
    }


def _warnings(calibration: Calibration) -> list[str]:
    out = calibration.left_out
    said = [f"left out, since the others contradict: {', '.join(out)}"] if out else []
    return [*said, *calibration.degeneracy.warnings, NOT_SEPARABLE]


def _parameters(calibration: Calibration) -> list[dict[str, Any]]:
    """Return the 11 genes with bounds; a standard deviation where one can be told."""
    solution, problem = calibration.solution, calibration.problem
    sigma = dict(zip(("u0", "v0"), np.sqrt(np.diag(solution.covariance)[2:4]), strict=True))
    sigma |= dict(
        zip(("t_x", "t_y", "t_z"), np.sqrt(np.diag(solution.covariance)[7:]), strict=True)
    )
    sigma |= dict(zip(("omega", "phi", "kappa"), _angle_sigmas(solution), strict=True))
    pose = GENES[5:]
    return [
        {
            "name": gene,
            "value": float(value),
            "low": problem.bounds[gene][0],
            "high": problem.bounds[gene][1],
            "sigma": float(sigma[gene]) if gene in sigma else None,
            "on_bound": gene in solution.on_bound,
            "searched": problem.known is None or gene in pose,
        }
        for gene, value in zip(GENES, solution.genes, strict=True)
    ]


def _angle_sigmas(solution: Solution) -> Array:
    """Return the standard deviations (3,) of omega, phi and kappa in rad.

    The covariance is over small turns of the leg in the camera's frame; the angles' slopes along
    them are taken by differences. They grow without bound where phi nears a right angle.
    """
    rotation, step = rotation_from_angles(solution.genes[8:11]), 1e-6
    turned = rotation_from_vector(np.vstack([np.eye(3), -np.eye(3)]) * step) @ rotation
    ahead, behind = np.split(angles_from_rotation(turned), 2)
    wrapped = (ahead - behind + np.pi) % (2.0 * np.pi) - np.pi
    slopes = wrapped.T / (2.0 * step)
    spread = slopes @ solution.covariance[4:7, 4:7] @ slopes.T
    return np.asarray(np.sqrt(np.maximum(np.diag(spread), 0.0)))


def _stations(calibration: Calibration, settings: CellSettings) -> list[dict[str, Any]]:
    rows = zip(
        settings.stations,
        calibration.stations,
        calibration.normals,
        calibration.solution.sigma_stations,
        strict=True,
    )
    return [
        {"station_mm": s, "place_mm": p.tolist(), "normal": n.tolist(), "sigma_mm": float(e)}
        for s, p, n, e in rows
    ]
