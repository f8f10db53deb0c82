"""The tests of a calibration that pictures alone can answer, each with its figure and a hint."""

from dataclasses import dataclass

import numpy as np

from legato.calibration.outcome import goodness
from legato.control.doubt import camera_doubt, mark_size, moved
from legato.control.perceive import Calibration
from legato.control.settings import CellSettings
from legato.vision.marks import Picking


@dataclass(frozen=True)
class Check:
    """One test: its figure against its limit, and what to do where it fails."""

    name: str
    ok: bool
    text: str
    hint: str
    figure: float | None = None
    limit: float | None = None
    unit: str = ""


def picture_checks(calibration: Calibration, settings: CellSettings) -> list[Check]:
    """Return the tests that one picture can answer."""
    checks = [
        _degenerate(calibration),
        _residuals(calibration, settings),
        _misfit(calibration),
        _on_bound(calibration, settings),
        _agreement(calibration, settings),
        _held_out(calibration, settings),
        _suspects(calibration),
        _sigma(calibration, settings),
        _camera(calibration),
        _mark_size(calibration, settings),
    ]
    return [c for c in checks if c is not None]


def second_picture_check(
    calibration: Calibration, second: Picking, settings: CellSettings
) -> Check:
    """Return whether a second picture puts the leg where the calibration does.

    In mm at the stations, from the second picture's own pose; its marks must also fit one another
    and lie where they are predicted.
    """
    limits = settings.calibration
    found = moved(calibration, second, limits.pixel_sigma)
    hint = "see that the leg stands still and that nothing shakes the camera, then run again"
    text = (
        f"the second picture's {found.count} marks put the worst station {found.mm:.2f} mm away, "
        f"and lie {found.px:.2f} px rms from the prediction"
    )
    check = limit("second picture", found.mm, limits.max_second_picture_mm, "mm", text, hint)
    if check.ok and found.px > limits.max_second_picture_px:
        text += f"; only {limits.max_second_picture_px:g} px are"
        return limit("second picture", found.px, limits.max_second_picture_px, "px", text, hint)
    if check.ok and found.misfit > found.limit:
        text = f"the second picture's {found.count} marks do not fit one another"
        return limit("second picture", found.misfit, found.limit, "", text, hint)
    return check


def limit(name: str, figure: float, most: float, unit: str, text: str, hint: str) -> Check:
    """Return the check of a figure that may not exceed a limit."""
    ok = bool(np.isfinite(figure) and figure <= most)
    allowed = f"{most:.3g} {unit}".strip()
    return Check(name, ok, f"{text} ({allowed} allowed)", hint, figure, most, unit)


def _degenerate(calibration: Calibration) -> Check:
    report = calibration.degeneracy
    count = len(calibration.problem.names)
    text = report.refused or f"{count} marks, not in one plane"
    more = " or ".join(report.add[:2]) or "P1 or P8 on the big face"
    return Check(
        "degenerate", report.refused is None, text, f"turn the leg so that {more} is seen",
        float(count),
    )  # fmt: skip


def _residuals(calibration: Calibration, settings: CellSettings) -> Check:
    rms = calibration.solution.rms_px
    return limit(
        "residuals", rms, settings.calibration.max_rms_px, "px",
        f"the marks lie {rms:.2f} px rms from where the pose puts them",
        "see that the leg model's measures and the intrinsics file are those of this cell",
    )  # fmt: skip


def _misfit(calibration: Calibration) -> Check:
    value, most = goodness(calibration.problem, calibration.solution)
    return limit(
        "noise", value, most, "",
        f"the residuals' chi-square, which noise alone keeps under the limit, is {value:.3g}",
        "see that the marks lie where [leg.marks] says, and that the intrinsics are this camera's; "
        "marks pasted less exactly than calibration.pixel_sigma says need a larger one",
    )  # fmt: skip


def _on_bound(calibration: Calibration, settings: CellSettings) -> Check:
    stuck = calibration.solution.on_bound
    ok = not stuck or settings.calibration.allow_on_bound
    text = f"on its bound: {', '.join(stuck)}" if stuck else "no parameter sits on its bound"
    return Check("bounds", ok, text, "widen [calibration.bounds] if the camera is truly there")


def _agreement(calibration: Calibration, settings: CellSettings) -> Check:
    share, least = calibration.solution.agreement, settings.calibration.min_agreement
    return Check(
        "agreement", share >= least,
        f"{100.0 * share:.0f} % of the searches ended in this pose ({100.0 * least:.0f} % needed)",
        "raise calibration.population, or show more marks", share, least,
    )  # fmt: skip


def _held_out(calibration: Calibration, settings: CellSettings) -> Check:
    if not calibration.held_out:
        return Check("held-out marks", False, "no mark could be left out", "show more marks")
    worst = max(calibration.held_out, key=lambda h: h.ratio)
    return limit(
        "held-out marks", worst.ratio, settings.calibration.max_held_out_ratio, "sigma",
        f"{worst.name}, left out, lies {worst.ratio:.1f} of its standard deviations "
        "from the prediction",
        f"look at {worst.name}: is it pasted and measured rightly, is it in full view?",
    )  # fmt: skip


def _suspects(calibration: Calibration) -> Check:
    found = calibration.suspects
    text = "every mark fits the others"
    if calibration.left_out:
        text = f"without {' and '.join(calibration.left_out)} every mark fits the others"
    if found.misfit > found.limit:
        named = f"without {' and '.join(found.names)} the others agree" if found.names else (
            "no one or two marks explain it"
        )  # fmt: skip
        text = f"the marks do not fit together: {named}"
    hint = "see that these marks are pasted and measured rightly, and not mistaken for others"
    return Check("suspects", found.misfit <= found.limit, text, hint, found.misfit, found.limit)


def _sigma(calibration: Calibration, settings: CellSettings) -> Check:
    worst = float(np.max(calibration.solution.sigma_stations, initial=0.0))
    free = calibration.problem.known is None
    hint = "calibrate the camera once (legato intrinsics) and name its file" if free else (
        "show more marks, sharper, or bring the camera nearer"
    )  # fmt: skip
    return limit(
        "station uncertainty", worst, settings.calibration.max_station_sigma_mm, "mm",
        f"the worst station is known to {worst:.2f} mm (one standard deviation)", hint,
    )  # fmt: skip


def _camera(calibration: Calibration) -> Check | None:
    """Return whether the marks contradict the intrinsics file; None where there is none."""
    doubt = camera_doubt(calibration)
    if doubt is None:
        return None
    return limit(
        "camera", doubt.gain, doubt.limit, "",
        f"another camera (alpha {100.0 * (doubt.alpha - 1.0):+.1f} %) would move the worst station "
        f"by {doubt.moved_mm:.2f} mm and fit better by {max(doubt.gain, 0.0):.1f} in chi-square",
        "calibrate the camera anew (legato intrinsics): focus, zoom or lens may have changed",
    )  # fmt: skip


def _mark_size(calibration: Calibration, settings: CellSettings) -> Check:
    """Return whether the marks are as large as they should be at their distance."""
    most = settings.calibration.max_mark_size_percent
    names = calibration.problem.names
    size, sigma = mark_size({n: calibration.picking.marks[n] for n in names})
    off, known = 100.0 * abs(size - 1.0), 100.0 * min(sigma, 1.0)
    return limit(
        "mark size", off + known, most, "%",
        f"the marks are {100.0 * (size - 1.0):+.2f} % of their size off, known to {known:.2f} %",
        "see that leg and marks have the measures that [leg] gives: a leg of another size seems "
        "to stand at another distance",
    )  # fmt: skip
