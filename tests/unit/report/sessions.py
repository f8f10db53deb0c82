"""Synthetic records: a cell that measures, moves and touches, written as the daemon writes them.

The estimate and the truth differ by a known turn and shift; everything else follows from geometry.
"""

import io
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.image import imsave
from numpy.typing import ArrayLike

from legato.calibration.problem import GENES, PAPER_BOUNDS
from legato.geometry.arm import ArmModel, forward, joints_from_steps
from legato.geometry.leg import Leg
from legato.geometry.motion import (
    ToolPose,
    move_between,
    pose_steps,
    rounded,
    straight_path,
)
from legato.geometry.projection import Intrinsics, project
from legato.geometry.transforms import (
    Array,
    angles_from_rotation,
    apply,
    invert,
    look_at,
    rotation_from_vector,
    transform,
)
from legato.records.session import SessionWriter
from legato.records.store import Store
from legato.records.trajectory import trajectory_row

LEG, ARM = Leg(), ArmModel()
CAMERA = Intrinsics(652.0, 655.0, 346.0, 279.0, -0.02)
STATIONS = (7.0, 67.0, 127.0, 187.0)
BEGAN = datetime(2026, 11, 22, 1, 47, tzinfo=UTC)
CONFIG: dict[str, Any] = {
    "robot": {"driver": "sim"},
    "camera": {"driver": "sim"},
    "leg": {"stations_mm": list(STATIONS), "approach_mm": 10.0},
    "massage": {"strokes": 3, "press_mm": 1.5, "contact_window_mm": 2.0},
    "cell": {"table_z_mm": 0.0, "workspace": {"x_mm": [40.0, 330.0]}},
    "sim": {"seed": 1, "text": "<script>alert(1)</script>"},
}


def pose(shift: tuple[float, float, float], turn_deg: float = 0.0) -> Array:
    """Return world_from_object: the paper's placement, shifted in mm and turned about z."""
    yaw = rotation_from_vector([0.0, 0.0, np.radians(90.0 + turn_deg)])
    rise = rotation_from_vector([0.0, -np.radians(5.75), 0.0])
    return transform(yaw @ rise, np.array([124.29, -64.03, 30.52]) + shift)


@dataclass
class Cell:
    """What is true, what is believed, and the session that is being written."""

    writer: SessionWriter
    believed: Array = field(default_factory=lambda: pose((0.0, 0.0, 0.0)))
    true: Array = field(default_factory=lambda: pose((0.2, -0.1, 0.15), 0.1))
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(1))
    t: float = 100.0
    pace: float = 1.0
    tip: ToolPose = field(default_factory=lambda: ToolPose(127.0, 0.0, 150.0))
    touches: list[dict[str, Any]] = field(default_factory=list)

    def event(self, kind: str, **data: Any) -> None:
        """Record an event now."""
        self.writer.event(kind, data, t=self.t, wall=self.wall())

    def wall(self) -> str:
        """Return the time of day: `pace` of the cell's seconds pass in one of the wall's."""
        return (BEGAN + timedelta(seconds=(self.t - 100.0) / self.pace)).isoformat()

    def enter(self, state: str, previous: str, seconds: float = 0.4) -> None:
        """Record a change of state and stay."""
        self.event("state", state=state, previous=previous, cause=None)
        self.t += seconds

    def look(self) -> None:
        """Take a picture: a lit cylinder's worth of noise, large enough to look at."""
        v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
        grey = 120.0 + 0.08 * u - 0.05 * v + self.rng.normal(0.0, 2.0, u.shape)
        rgb = np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
        out = io.BytesIO()
        imsave(out, rgb, format="png")
        self.writer.frame("capture", out.getvalue())

    def calibrate(self, *, accepted: bool = True) -> None:
        """Write calibration.json as a solve of this cell would."""
        self.writer.document("calibration", calibration(self.believed, self.rng, accepted))

    def to(self, place: ArrayLike, why: str, station: float | None = None) -> None:
        """Move in a straight line; at the leg stop where the switch closes."""
        goal = ToolPose(*(float(c) for c in np.asarray(place)))
        start = tuple(int(v) for v in np.rint(pose_steps(ARM, self.tip.vector())))
        whole = [start, *rounded(straight_path(ARM, self.tip, goal, scale=0.8))]
        for a, b in pairwise(whole):
            self.t += move_between(ARM, a, b, 0.8).duration + 0.01
            joints, _ = joints_from_steps(ARM, b)
            xyz, _, _ = forward(ARM, joints)
            depth = -float(LEG.clearance(apply(invert(self.true), xyz[None]))[0])
            self._touch(xyz, depth)
            row = trajectory_row(
                t=self.t, commanded=b, read=b, joints=joints.tolist(),
                xyz=xyz.tolist(), contact=depth > 0.15, station=station, why=why,
            )  # fmt: skip
            self.writer.trajectory(row)
            self.tip = ToolPose(*(float(c) for c in xyz))

    def _touch(self, xyz: Array, depth: float) -> None:
        """Keep the world's account of a touch."""
        if depth <= 0.0:
            if self.touches and self.touches[-1]["ended_s"] is None:
                self.touches[-1]["ended_s"] = self.t
            return
        if not self.touches or self.touches[-1]["ended_s"] is not None:
            place = apply(invert(self.true), xyz[None])[0].tolist()
            self.touches.append(
                {"surface": "leg", "began_s": self.t - 0.01, "ended_s": None,
                 "world_mm": xyz.tolist(), "object_mm": place, "along_mm": place[0],
                 "depth_mm": 0.0, "force_n": 0.0}
            )  # fmt: skip
        touch = self.touches[-1]
        touch["depth_mm"] = max(touch["depth_mm"], depth)
        touch["force_n"] = 2.0 * touch["depth_mm"]

    def massage(self, station: float, strokes: int = 3) -> None:
        """Make one pass: approach, then strokes of descent, press, dwell, retract."""
        place, up = surface(self.believed, station)
        above = place + 10.0 * up
        self.to([above[0], above[1], max(self.tip.z, above[2])], "transit")
        self.to(above, "approach")
        for stroke in range(1, strokes + 1):
            self.event("progress", text="stroke", station_mm=station, stroke=stroke)
            height = self._descend(place, up, station)
            pressed = place + (height - 1.5) * up
            self._contact(place, station, stroke, height)
            self.to(pressed, "press", station)
            self.t += 1.0
            self.to(above, "retract", station)

    def _descend(self, place: Array, up: Array, station: float) -> float:
        height = 10.0
        while height > -3.0:
            height -= 0.5
            self.to(place + height * up, "descend", station)
            tip = self.tip.xyz
            if LEG.clearance(apply(invert(self.true), tip[None]))[0] < -0.15:
                break
        return height

    def _contact(self, place: Array, station: float, stroke: int, height: float) -> None:
        along, across, _ = apply(invert(self.believed), self.tip.xyz[None])[0]
        self.event(
            "contact", station_mm=station, stroke=stroke, contact_mm=height + 0.25,
            place_mm=float(along), across_mm=float(across), xyz_mm=self.tip.xyz.tolist(),
            predicted_xyz_mm=place.tolist(), steps_after=[0] * 6,
        )  # fmt: skip

    def testify(self, **more: Any) -> None:
        """Write truth.json."""
        truth = {"world_from_object": self.true.tolist(), "touches": self.touches, "breaches": []}
        self.writer.document("truth", truth | more)


def surface(world_from_object: Array, station: float) -> tuple[Array, Array]:
    """Return a station's place and normal in the robot base frame."""
    place = apply(world_from_object, LEG.surface_point(station)[None])[0]
    return place, world_from_object[:3, :3] @ LEG.surface_normal()


def calibration(
    world_from_object: Array, rng: np.random.Generator, accepted: bool
) -> dict[str, Any]:
    """Return the document of a solve with one mark missing."""
    world_from_camera = look_at((228.6, -101.6, 50.8), (126.0, -4.0, 36.0))
    camera_from_object = invert(world_from_camera) @ world_from_object
    names = [n for n in LEG.names() if n != "P9"]
    predicted = project(CAMERA, camera_from_object, LEG.points(tuple(names)))
    residuals = rng.normal(0.0, 0.05, predicted.shape)
    genes = [1.0, 652.0, 655.0, 346.0, 279.0, *camera_from_object[:3, 3]]
    genes += angles_from_rotation(camera_from_object[:3, :3]).tolist()
    generations = np.arange(60)
    best = 4e4 * np.exp(-generations / 7.0) + 0.4
    tests = [("residuals", 0.07, 0.5, "px", True), ("station uncertainty", 0.11, 0.3, "mm", True)]
    tests += [("held-out marks", 5.2, 4.0, "sigma", accepted)]
    return {
        "accepted": accepted,
        "reasons": [] if accepted else ["P10, left out, lies 5.2 of its standard deviations off"],
        "engine": "hybrid",
        "intrinsics": "known",
        "marks": dict(zip(names, (predicted - residuals).tolist(), strict=True)),
        "missing": {"P9": "hidden by glare"},
        "residuals": dict(zip(names, residuals.tolist(), strict=True)),
        "rms_px": float(np.sqrt((residuals**2).sum(axis=1).mean())),
        "camera_from_object": camera_from_object.tolist(),
        "world_from_object": world_from_object.tolist(),
        "world_from_camera": world_from_camera.tolist(),
        "alpha_u": 652.0, "alpha_v": 655.0, "u0": 346.0, "v0": 279.0, "k1": -0.02, "k2": 0.0,
        "width": 768, "height": 576,
        "parameters": [
            {"name": g, "value": float(v), "low": PAPER_BOUNDS[g][0], "high": PAPER_BOUNDS[g][1],
             "sigma": 0.08 if i >= 5 else None, "on_bound": False, "searched": i >= 5}
            for i, (g, v) in enumerate(zip(GENES, genes, strict=True))
        ],
        "sigma": {"rotation_deg": 0.04, "translation_mm": 0.1, "stations_mm": [0.1] * 4},
        "agreement": 1.0,
        "suspects": [],
        "warnings": ["eight of the marks lie in one plane"],
        "trace": {"best": best.tolist(), "mean": (best * 6.0 + 30.0).tolist()},
        "generations": 60,
        "stopped_by": "generations",
        "seconds": 0.21,
        "checks": [
            {"name": n, "figure": f, "limit": m, "unit": u, "ok": ok, "text": f"{n} {f:g} {u}",
             "hint": "look at P10"}
            for n, f, m, u, ok in tests
        ],
        "stations": [
            {"station_mm": s, "place_mm": surface(world_from_object, s)[0].tolist(),
             "normal": surface(world_from_object, s)[1].tolist(), "sigma_mm": 0.08 + s / 2000.0}
            for s in STATIONS
        ],
        "picture": "frames/capture.png",
        "leg": {"big_radius_mm": 30.5, "small_radius_mm": 9.75, "length_mm": 194.0,
                "marks": {n: list(p) for n, p in LEG.marks.items()}},
    }  # fmt: skip


def begun(state_dir: Path, job: str = "run", pace: float = 1.0) -> Cell:
    """Begin a session of a simulated cell in a fresh store, its clock `pace` times the wall's."""
    config = {**CONFIG, "sim": {**CONFIG["sim"], "time_scale": pace}}
    meta = {
        "job": job, "params": {"seed": 1}, "key": None, "started": BEGAN.isoformat(),
        "simulated": True, "versions": {"legato": "0.1.0", "numpy": "2.4.6"}, "boot": "b00t",
        "config_hash": "c0ffee", "config": config,
    }  # fmt: skip
    return Cell(Store(state_dir, token=lambda: "5f3a").begin(meta), pace=pace)


def whole_session(state_dir: Path, pace: float = 1.0) -> Path:
    """Write a whole session that ends as done, and return its folder."""
    cell = begun(state_dir, pace=pace)
    cell.enter("capture", "idle")
    cell.look()
    cell.enter("calibrate", "capture", 0.9)
    cell.calibrate()
    cell.enter("verify", "calibrate", 0.6)
    cell.enter("move_home", "verify")
    previous = "move_home"
    for station in STATIONS:
        cell.enter(f"massage_{station:g}", previous, 0.0)
        cell.massage(station)
        previous = f"massage_{station:g}"
    cell.enter("move_home", previous, 0.0)
    cell.to([cell.tip.x, cell.tip.y, 150.0], "transit")
    cell.to([127.0, 0.0, 150.0], "transit")
    cell.enter("idle", "move_home", 0.0)
    cell.testify()
    cell.event("session", id=cell.writer.id, job="run", outcome="done", reason=None)
    cell.writer.finish("done", None, None, cell.wall())
    return cell.writer.path
