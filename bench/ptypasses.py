"""The whole job over the serial line: real daemon, TeachMover's driver, emulator's pseudo-terminal.

Random leg poses in scaled time; `truetime` has the paper's in true time. The daemon finds the leg
in its pictures; what was touched, asked too much or run against a stop is what the emulator's own
world says, of which the daemon knows nothing. As in a lab, the camera is set up before the leg.
"""

import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from bench.passes import PLACES, rms
from bench.row import Row, keep
from legato.drivers.sim.settings import SimSettings
from legato.geometry.leg import Leg
from legato.geometry.transforms import rotation_from_vector
from tests.system.emulated import Cell, Tables, ended, running

POSES = 100
BACKLASH = 6.0
SCALE = 40.0
AT_ONCE = 3  # cells side by side; more would starve one another on two cores
ON_A_REST = [-4.0, 40.0]  # mm over the table of the leg's lowest point: many lie on something
STATIONS = (7.0, 67.0, 127.0, 187.0)
STROKES = 3
Found = dict[str, Any]


def run() -> list[Row]:
    """Return where the touches lie, and which poses were refused."""
    reached, refused = massaged(POSES)
    rows = [*touches("ptypasses", reached), *refusals(refused)]
    keep(
        "ptypasses",
        rows,
        poses=POSES,
        backlash_steps=BACKLASH,
        time_scale=SCALE,
        drawn=drawn_of(reached),
        broken_off=[
            r["pose"] | {"outcome": r["outcome"], "reason": r["reason"]}
            for r in reached
            if r["outcome"] != "done"
        ],
        refused=[r["pose"] | {"reasons": r["reason"]} for r in refused],
    )
    return rows


def massaged(count: int) -> tuple[list[Found], list[Found]]:
    """Massage random poses until so many were reached; return those, and the refused ones."""
    rng = np.random.default_rng(4)
    reached: list[Found] = []
    refused: list[Found] = []
    with ThreadPoolExecutor(AT_ONCE) as pool:
        number = 0
        while len(reached) < count:
            batch = [(number + k, drawn(rng)) for k in range(min(12, count - len(reached)))]
            number += len(batch)
            for found in pool.map(lambda drawing: massage(*drawing), batch):
                (refused if found["outcome"] == "refused" else reached).append(found)
    return reached, refused


def drawn(rng: np.random.Generator) -> dict[str, Any]:
    """Draw a leg anywhere the arm might reach, yaw +-25, rise and roll +-6 deg, as [sim] has it."""
    place = rng.uniform(*PLACES)
    yaw, rise, roll = np.array([90.0, 5.75, 0.0]) + rng.uniform(-1, 1, 3) * [25, 6, 6]
    return seen(
        {
            "leg_at_mm": [round(float(v), 3) for v in place],
            "leg_yaw_deg": round(float(yaw), 3),
            "leg_rise_deg": round(float(rise), 3),
            "leg_roll_deg": round(float(roll), 3),
        }
    )


def seen(pose: dict[str, Any]) -> dict[str, Any]:
    """Return a leg's pose as [sim] has it, with a camera before it.

    The camera has the paper's place as seen from the leg: from there big face and side are in view.
    """
    default = SimSettings()
    turn = np.radians(pose["leg_yaw_deg"] - default.leg_yaw_deg)
    about = rotation_from_vector([0.0, 0.0, turn])
    ends = np.array([default.camera_at_mm, default.camera_looks_at_mm]) - default.leg_at_mm
    at, looks_at = ends @ about.T + pose["leg_at_mm"]
    return pose | {
        "camera_at_mm": [round(float(v), 3) for v in at],
        "camera_looks_at_mm": [round(float(v), 3) for v in looks_at],
        "scatter_mm": 0.0,
        "scatter_deg": 0.0,
    }


def massage(
    seed: int,
    pose: dict[str, Any],
    *,
    scale: float = SCALE,
    dwell_s: float = 0.02,
    look: Callable[[Cell, str], Any] = lambda _, __: None,
) -> Found:
    """Run the whole job on a pose; return its outcome, touches, breaches and what `look` finds."""
    stands = ("camera_at_mm", "camera_looks_at_mm")
    camera: dict[str, Any] = {name: pose[name] for name in stands if name in pose}
    tables: Tables = {
        "massage": {"dwell_s": dwell_s},
        "robot": {"speed_scale": 1.0},
        "cell": camera,
        "calibration": {"leg_rests_mm": ON_A_REST},
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with running(folder, scale=scale, tables=tables, seed=seed, backlash_steps=BACKLASH,
                     **pose) as (cell, client):  # fmt: skip
            answer = ended(client, "run")
            truth = cell.truth()
        return {
            "pose": pose,
            "outcome": answer["outcome"],
            "reason": answer["reason"],
            "errors": errors(truth, answer["outcome"]),
            "bad": len(truth["breaches"]) + sum(t["surface"] != "leg" for t in truth["touches"]),
            "lost": float(np.abs(truth["lost_steps"]).sum()),
            "moved": truth["account"]["commands"]["step"],
            "line": look(cell, answer["session"]),
        }


def errors(truth: dict[str, Any], outcome: str) -> list[float]:
    """Return each true touch's distance from its station, in mm; inf for each that is missing."""
    wanted = np.repeat(Leg().surface_point(STATIONS), STROKES, axis=0)
    places = np.array([t["object_mm"] for t in truth["touches"]]).reshape(-1, 3)
    if outcome != "done":
        return []
    if len(places) != len(wanted):
        return [np.inf]
    return [float(e) for e in np.linalg.norm(places - wanted, axis=1)]


def touches(here: str, runs: list[Found]) -> Iterator[Row]:
    """Yield where the touches of some runs lie, and what went wrong in them."""
    found = np.array([e for r in runs for e in r["errors"]])
    yield Row(f"{here}: poses massaged to the end", sum(r["outcome"] == "done" for r in runs), "",
              len(runs), at_least=True)  # fmt: skip
    yield Row(f"{here}: touch off its station, rms", rms(found), "mm", 0.5)
    yield Row(f"{here}: touch off its station, worst", float(found.max()), "mm", 1.0)
    yield Row(f"{here}: touches elsewhere, rates, limits", sum(r["bad"] for r in runs), "", 0)
    yield Row(f"{here}: half-steps lost", sum(r["lost"] for r in runs), "", 0)


def refusals(refused: list[Found]) -> Iterator[Row]:
    """Yield how many poses verify has refused, for what, and whether the arm stood still."""
    reach = [r for r in refused if "station " in r["reason"]]
    yield Row("ptypasses: refused by verify", len(refused), "")
    yield Row("ptypasses: of these out of reach", len(reach), "")
    unnamed = [r for r in reach if not any(part in r["reason"] for part in PARTS)]
    yield Row("ptypasses: refused without naming station and joint or part", len(unnamed), "", 0)
    yield Row("ptypasses: motions on refused poses", sum(r["moved"] for r in refused), "", 0)


PARTS = ("base", "shoulder", "elbow", "wrist", "roll", "hand", "forearm", "finger", "workspace",
         "reach")  # fmt: skip


def drawn_of(runs: list[Found]) -> list[dict[str, Any]]:
    """Return the poses of some runs, and how far their worst touch was off."""
    return [r["pose"] | {"worst_mm": max(r["errors"], default=None)} for r in runs]
