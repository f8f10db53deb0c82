"""The tests that a calibration must pass before the arm may move by it, each with its figure.

What pictures can answer stands in control.checks; here is what the leg's place in the cell decides.
"""

import numpy as np

from legato.control.checks import Check
from legato.control.perceive import Calibration
from legato.control.rehearsal import dry_run
from legato.control.settings import CellSettings


def cell_checks(calibration: Calibration, settings: CellSettings) -> list[Check]:
    """Return the tests of the leg's place in the cell: table, workspace, reach, clearance."""
    return [
        _rests(calibration, settings),
        _workspace(calibration, settings),
        _reachable(calibration, settings),
    ]


def lowest_point(calibration: Calibration, settings: CellSettings) -> float:
    """Return how high the leg's lowest point lies over the table, mm."""
    pose, leg = calibration.world_from_object, settings.leg
    upright = np.sqrt(max(0.0, 1.0 - pose[2, 0] ** 2))
    ends = ((0.0, leg.big_radius), (leg.length, leg.small_radius))
    low = min(pose[2, 3] + x * pose[2, 0] - radius * upright for x, radius in ends)
    return float(low - settings.workspace.table_z)


def _rests(calibration: Calibration, settings: CellSettings) -> Check:
    """Return whether the leg lies on the table, or as high over it as it may."""
    low, high = settings.calibration.leg_rests_mm
    height = lowest_point(calibration, settings)
    text = (
        f"the leg's lowest point lies {height:+.1f} mm over the table "
        f"({low:g} to {high:g} mm allowed)"
    )
    hint = (
        "see that camera and table stand where [cell] says and that the leg has the size that "
        "[leg] says; set calibration.leg_rests_mm for a leg that lies on something"
    )
    return Check("table", low <= height <= high, text, hint, height, low if height < low else high,
                 "mm")  # fmt: skip


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
