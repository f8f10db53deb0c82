"""The tests that a calibration must pass before the arm may move by it, each with its figure."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from legato.control.effects import Move, Why
from legato.control.envelope import broken
from legato.control.perceive import Calibration, disagreement
from legato.control.plan import StationPlan, plan_stations, transit
from legato.control.settings import CellSettings
from legato.geometry.arm import Unreachable
from legato.geometry.motion import ToolPose, move_between, pose_steps, rounded, straight_path
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
    return [
        _degenerate(calibration),
        _rms(calibration, settings),
        _on_bound(calibration, settings),
        _held_out(calibration, settings),
        _suspects(calibration),
        _sigma(calibration, settings),
    ]


def cell_checks(calibration: Calibration, settings: CellSettings) -> list[Check]:
    """Return the tests of the leg's place in the cell: workspace, reach, clearance."""
    return [_workspace(calibration, settings), _reachable(calibration, settings)]


def second_picture_check(
    calibration: Calibration, second: Picking, settings: CellSettings
) -> Check:
    """Return whether a second picture's marks lie where the calibration predicts them."""
    apart, count = disagreement(calibration, second)
    limit = settings.calibration.max_second_picture_px
    return _limit(
        "second picture",
        apart,
        limit,
        "px",
        f"the second picture's {count} marks lie {apart:.2f} px from the prediction",
        "see that the leg stands still and that nothing shakes the camera, then run again",
    )


def _limit(name: str, figure: float, limit: float, unit: str, text: str, hint: str) -> Check:
    ok = bool(np.isfinite(figure) and figure <= limit)
    return Check(name, ok, f"{text} ({limit:g} {unit} allowed)".replace(" )", ")"), hint, figure,
                 limit, unit)  # fmt: skip


def _degenerate(calibration: Calibration) -> Check:
    why = calibration.degeneracy.refused
    text = why or f"{len(calibration.problem.names)} marks, not in one plane"
    hint = "turn the leg so that P1 or P8 on the big face is seen"
    return Check("degenerate", why is None, text, hint, float(len(calibration.problem.names)))


def _rms(calibration: Calibration, settings: CellSettings) -> Check:
    rms = calibration.solution.rms_px
    return _limit(
        "residuals", rms, settings.calibration.max_rms_px, "px",
        f"the marks lie {rms:.2f} px rms from where the pose puts them",
        "see that the leg model's measures and the intrinsics file are those of this cell",
    )  # fmt: skip


def _on_bound(calibration: Calibration, settings: CellSettings) -> Check:
    stuck = calibration.solution.on_bound
    ok = not stuck or settings.calibration.allow_on_bound
    text = f"on its bound: {', '.join(stuck)}" if stuck else "no parameter sits on its bound"
    return Check("bounds", ok, text, "widen [calibration.bounds] if the camera is truly there")


def _held_out(calibration: Calibration, settings: CellSettings) -> Check:
    if not calibration.held_out:
        return Check("held-out marks", False, "no mark could be left out", "show more marks")
    worst = max(calibration.held_out, key=lambda h: h.ratio)
    return _limit(
        "held-out marks", worst.ratio, settings.calibration.max_held_out_ratio, "sigma",
        f"{worst.name}, left out, lies {worst.ratio:.1f} of its standard deviations "
        "from the prediction",
        f"look at {worst.name}: is it pasted and measured rightly, is it in full view?",
    )  # fmt: skip


def _suspects(calibration: Calibration) -> Check:
    found = calibration.suspects
    text = "every mark fits the others"
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
    return _limit(
        "station uncertainty", worst, settings.calibration.max_station_sigma_mm, "mm",
        f"the worst station is known to {worst:.2f} mm (one standard deviation)", hint,
    )  # fmt: skip


def _workspace(calibration: Calibration, settings: CellSettings) -> Check:
    low, high = np.array(settings.workspace.low), np.array(settings.workspace.high)
    out = [
        f"{station:g} mm"
        for station, place in zip(settings.stations, calibration.stations, strict=True)
        if ((place < low) | (place > high)).any()
    ]
    text = f"outside the workspace: station {', '.join(out)}" if out else (
        "every station lies in the workspace"
    )  # fmt: skip
    return Check("workspace", not out, text, "move the leg toward the middle of the workspace")


def _reachable(calibration: Calibration, settings: CellSettings) -> Check:
    problems = dry_run(calibration, settings)
    text = problems[0] if problems else "every pass can be reached, clear of leg and table"
    return Check("reach", not problems, text, "move the leg into the arm's reach")


@dataclass(frozen=True)
class Way:
    """Poses to be passed through in straight lines, and where the fingertip may touch on it."""

    poses: tuple[ToolPose, ...]
    why: Why
    station: float | None = None
    until: float | None = None


def dry_run(calibration: Calibration, settings: CellSettings) -> list[str]:
    """Return what would go wrong in a massage from home to home, one sentence for each station."""
    problems = []
    here = settings.home
    plans = plan_stations(settings, calibration)
    for plan, onward in zip(plans, [*plans[1:], None], strict=True):
        ways = _ways(settings, here, plan, onward, first=here is settings.home)
        found = next(filter(None, (_try_way(settings, calibration, way) for way in ways)), None)
        if found:
            problems.append(f"station {plan.station:g} mm: {found}")
        here = plan.approach
    home = Way((here, *transit(settings, here, settings.home)), Why.TRANSIT)
    found = _try_way(settings, calibration, home)
    return problems + ([f"the way home: {found}"] if found else [])


def _ways(
    settings: CellSettings,
    here: ToolPose,
    plan: StationPlan,
    onward: StationPlan | None,
    first: bool,
) -> list[Way]:
    """Return a pass at one station: to the lead-in, to the approach, down, and on if it draws."""
    lead_in = transit(settings, here, plan.lead_in) if first else [plan.lead_in]
    massage = settings.massage
    deepest = plan.at(-massage.contact_window_mm - massage.press_mm)
    ways = [
        Way((here, *lead_in), Why.TRANSIT),
        Way((plan.lead_in, plan.approach), Why.APPROACH),
        Way((plan.approach, deepest), Why.DESCEND, plan.station),
    ]
    if onward is not None and massage.draw.count:
        depth = -massage.contact_window_mm - massage.draw.depth_mm
        along = (plan.at(depth), onward.at(depth), onward.approach)
        ways.append(Way(along, Why.DRAW, plan.station, onward.station))
    return ways


def _try_way(settings: CellSettings, calibration: Calibration, way: Way) -> str | None:
    """Return the first thing that forbids a way, None where it is safe."""
    for start, end in pairwise(way.poses):
        try:
            path = straight_path(settings.arm, start, end, scale=settings.speed_scale)
        except Unreachable as error:
            return str(error)
        whole = rounded(np.vstack([pose_steps(settings.arm, start.vector()), path]))
        for a, b in pairwise(whole):
            step = move_between(settings.arm, a, b, settings.speed_scale)
            move = Move(step, a, b, way.why, way.station, way.until)
            problems = broken(settings, calibration.world_from_object, move)
            if problems:
                return problems[0]
    return None
