"""What the procedures are told: the `[calibration]` and `[massage]` tables and the cell's geometry.

Names of the Structs' fields are the configuration's keys.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import Meta, Struct

from legato.calibration.problem import EngineSettings, KnownIntrinsics
from legato.geometry.arm import ArmModel
from legato.geometry.leg import Leg
from legato.geometry.motion import ToolPose
from legato.geometry.projection import Intrinsics
from legato.geometry.shapes import Shapes
from legato.geometry.transforms import Array

Positive = Annotated[float, Meta(gt=0, le=1_000_000)]
Seconds = Annotated[float, Meta(ge=0, le=60)]
Bound = Annotated[float, Meta(ge=-1_000_000, le=1_000_000)]
Range = tuple[Bound, Bound]

EngineName = Literal["hybrid", "paper", "separable"]


class BoundsSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Lower and upper bound of each gene (mm, rad, px); the paper's table 5.3 by default."""

    f: Range = (3.0, 25.0)
    s_x: Range = (90.0, 250.0)
    s_y: Range = (90.0, 250.0)
    u0: Range = (280.0, 360.0)
    v0: Range = (210.0, 320.0)
    t_x: Range = (-150.0, 150.0)
    t_y: Range = (-200.0, 200.0)
    t_z: Range = (0.0, 300.0)
    omega: Range = (-3.141592653589793, 3.141592653589793)
    phi: Range = (-3.141592653589793, 3.141592653589793)
    kappa: Range = (-3.141592653589793, 3.141592653589793)


class CalibrationSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How the leg is found, and the limits that verify holds the result to."""

    engine: EngineName = "hybrid"
    intrinsics: Literal["known", "free"] = "known"
    """known: from the camera's intrinsics file; free: estimated within the bounds."""
    marks: tuple[str, ...] = ()
    """Marks to use; all that are found where empty."""
    bounds: BoundsSettings = BoundsSettings()
    population: Annotated[int, Meta(ge=10, le=10_000)] = 200
    generations: Annotated[int, Meta(ge=1, le=100_000)] = 2000
    crossover_rate: Annotated[float, Meta(gt=0, le=1)] = 0.8
    mutation_rate: Annotated[float, Meta(ge=0, le=1)] = 0.1
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 1
    pixel_sigma: Positive = 0.03
    """No mark's coordinates are trusted to better than this, in px: it stands for what picking
    cannot know, such as marks pasted by hand (0.2 mm at 160 mm is about 1 px)."""
    max_rms_px: Positive = 0.5
    max_station_sigma_mm: Positive = 0.3
    max_held_out_ratio: Positive = 4.0
    """A mark left out may be off by so many of its own predicted standard deviations."""
    max_second_picture_px: Positive = 0.5
    """How far marks of the second picture may lie, rms, from where the first predicts them."""
    max_second_picture_mm: Positive = 0.4
    """How far the second picture's own pose may put a station from where the first puts it."""
    min_agreement: Annotated[float, Meta(ge=0, le=1)] = 0.1
    """Share of the searches that must end in the pose that is taken."""
    max_mark_size_percent: Positive = 0.3
    """How far the marks' mean size may be off: 0.4 % stands for 1 mm at the farthest station. A leg
    of another size with marks of the right one is told by this alone; 1000 never refuses."""
    leg_rests_mm: Range = (-4.0, 8.0)
    """How high over the table the leg's lowest point may lie; -1000 to 1000 never refuses. A leg of
    another size with marks of that size too is told by this alone."""
    allow_on_bound: bool = False
    fresh_s: Annotated[float, Meta(gt=0, le=604_800)] = 3600.0
    """A verified calibration older than this is not used for a massage."""


class DrawSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Strokes that press at one station and draw along the leg to the next."""

    count: Annotated[int, Meta(ge=0, le=100)] = 0
    """From each station but the last; none is the paper's massage."""
    depth_mm: Annotated[float, Meta(ge=0, le=5)] = 1.0
    speed_mm_s: Annotated[float, Meta(gt=0, le=100)] = 20.0
    dwell_s: Seconds = 0.5


class MassageSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One pass: strokes at one station."""

    strokes: Annotated[int, Meta(ge=1, le=100)] = 3
    press_mm: Annotated[float, Meta(ge=0, le=5)] = 1.5
    press_steps: Annotated[int, Meta(ge=0, le=50)] = 0
    """Guarded steps beyond contact, each looked at like those before it; 0 presses `press_mm`."""
    press_speed_mm_s: Annotated[float, Meta(gt=0, le=100)] = 50.0
    dwell_s: Seconds = 1.0
    contact_window_mm: Annotated[float, Meta(gt=0, le=8)] = 2.0
    """How far above or below the predicted surface the switch may close."""
    descent_mm: Annotated[float, Meta(gt=0, le=0.5)] = 0.5
    """Length of one guarded step."""
    drift_mm: Positive = 1.0
    """How far a station's contact may wander from its first stroke before the leg counts as
    moved."""
    follow_normal: bool = False
    """Lean the hand along the surface normal, as far as its pitch allows, instead of -90 deg."""
    draw: DrawSettings = DrawSettings()

    @property
    def depths(self) -> tuple[float, ...]:
        """How far beyond contact the press goes, motion by motion, mm."""
        if self.press_steps:
            return tuple((k + 1) * self.descent_mm for k in range(self.press_steps))
        return (self.press_mm,)


@dataclass(frozen=True)
class Workspace:
    """The box that the fingertip may be in, and the table, in the robot base frame."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    table_z: float = 0.0


@dataclass(frozen=True)
class CellSettings:
    """Everything that a procedure needs to know of the cell; built from the configuration."""

    leg: Leg
    stations: tuple[float, ...]
    approach: float
    arm: ArmModel
    shapes: Shapes
    speed_scale: float
    home: ToolPose
    start: ToolPose
    lead_in: float
    workspace: Workspace
    world_from_camera: Array
    nominal: Intrinsics
    known: KnownIntrinsics | None
    calibration: CalibrationSettings
    engine: EngineSettings
    massage: MassageSettings
    simulated_devices: tuple[str, ...]
    """Of arm and camera, those that are no real ones."""
    camera_dated_s: float | None = None
    """When the known intrinsics were made, s since 1970; None where there are none."""
    camera_days: float = float("inf")
    """How many days they hold."""

    @property
    def simulated(self) -> bool:
        """Whether the arm or the camera is no real one."""
        return bool(self.simulated_devices)
