"""The configuration's tables as types. Names are the file's keys and are fixed.

Tables that belong to one layer are defined there (`[calibration]`, `[massage]`, `[sim]`); the
rest stand here. Values out of range, unknown keys and wrong types are refused at decoding.
"""

from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from legato.control.settings import CalibrationSettings, MassageSettings
from legato.drivers.faulty.settings import FaultSettings
from legato.drivers.sim.settings import SimSettings
from legato.geometry.leg import PAPER_MARKS

# Upper bounds are far beyond any cell: they keep slips of the pen out of sums and of waiting.
Length = Annotated[float, Meta(gt=0, le=10_000)]
Rate = Annotated[float, Meta(gt=0, le=1_000_000)]
Seconds = Annotated[float, Meta(gt=0, le=60)]
Place = Annotated[float, Meta(ge=-100_000, le=100_000)]
Turn = Annotated[float, Meta(ge=-3600, le=3600)]
Point = tuple[Place, Place, Place]
Named = Annotated[str, Meta(pattern=r"\S")]
Row = tuple[Place, Place, Place, Place]
DegRange = tuple[Turn, Turn]


class CurveTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The daemon's side of the encryption: its own secret, and the folder of those it lets in."""

    secret: Named
    clients: Named


class ServerTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where the daemon listens, and the keys of both sides.

    A port of `*` takes a free one and logs it.
    """

    requests: str = "tcp://127.0.0.1:5760"
    events: str = "tcp://127.0.0.1:5761"
    stop: str = "tcp://127.0.0.1:5762"
    curve: CurveTable | None = None
    client_secret: str | None = None
    server_public: str | None = None

    @property
    def is_client(self) -> bool:
        """Whether a client of this configuration talks to the daemon in secret."""
        return self.client_secret is not None and self.server_public is not None


class PoseTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A pose of the fingertip in the robot base frame."""

    xyz_mm: Point
    pitch_deg: Turn = -90.0
    roll_deg: Turn = 0.0


class RobotTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The arm: which driver, its line, its measures and limits (manual's figures by default)."""

    driver: Literal["sim", "teachmover"] = "sim"
    port: Named = "/dev/ttyUSB0"
    baud: Literal[110, 150, 300, 600, 1200, 2400, 4800, 9600] = 9600
    reply_margin_s: Seconds = 1.0
    switch_mask: Annotated[int, Meta(ge=1, le=255)] = 0x80
    switch_active_low: bool = False
    speed_scale: Annotated[float, Meta(gt=0, le=1)] = 0.8
    roll_sign: Literal[1, -1] = 1
    rates: tuple[Rate, Rate, Rate, Rate, Rate, Rate] = (
        473.0, 405.0, 543.0, 494.0, 494.0, 292.0,
    )  # fmt: skip
    steps_per_rev: tuple[Rate, Rate, Rate, Rate, Rate] = (
        7072.0, 7072.0, 4158.0, 1536.0, 1536.0,
    )  # fmt: skip
    grip_steps_per_in: Rate = 371.0
    grip_per_elbow: Annotated[float, Meta(ge=-10, le=10)] = 1.0
    shoulder_height_mm: Length = 193.675
    upper_arm_mm: Length = 177.8
    forearm_mm: Length = 177.8
    hand_mm: Length = 96.52
    base_deg: DegRange = (-90.0, 90.0)
    shoulder_deg: DegRange = (-35.0, 144.0)
    elbow_deg: DegRange = (-149.0, 0.0)
    wrist_deg: DegRange = (-90.0, 90.0)
    roll_deg: DegRange = (-360.0, 360.0)
    hand_radius_mm: Length = 20.0
    finger_length_mm: Length = 45.0
    finger_radius_mm: Length = 8.0
    forearm_radius_mm: Length = 25.0
    base_radius_mm: Length = 45.0
    home: PoseTable = PoseTable(xyz_mm=(127.0, 0.0, 150.0))
    start: PoseTable = PoseTable(xyz_mm=(127.0, 0.0, 0.0))
    lead_in_mm: Annotated[float, Meta(ge=0, le=30)] = 8.0


class CameraTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The camera: which driver, its source, the picture's size, its intrinsics."""

    driver: Literal["sim", "opencv"] = "sim"
    source: Named | int = 0
    width: Annotated[int, Meta(ge=320, le=4096)] = 768
    height: Annotated[int, Meta(ge=240, le=4096)] = 576
    timeout_s: Seconds = 3.0
    max_age_s: Seconds = 1.0
    intrinsics: str | None = None
    max_intrinsics_age_days: Annotated[float, Meta(gt=0, le=100_000)] = 730.0
    nominal_alpha_px: Annotated[float, Meta(gt=0, le=100_000)] = 650.0


class WorkspaceTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The box that the fingertip may be in."""

    x_mm: tuple[Place, Place] = (40.0, 330.0)
    y_mm: tuple[Place, Place] = (-250.0, 250.0)
    z_mm: tuple[Place, Place] = (0.0, 300.0)


class CellTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where the camera stands in the robot base frame, the table, and the workspace."""

    world_from_camera: tuple[Row, Row, Row, Row] | None = None
    camera_at_mm: Point | None = None
    camera_looks_at_mm: Point | None = None
    table_z_mm: Place = 0.0
    workspace: WorkspaceTable = WorkspaceTable()


class LegTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The leg model's measures and marks in its own frame (paper section 4)."""

    big_radius_mm: Length = 30.5
    small_radius_mm: Length = 9.75
    length_mm: Length = 194.0
    mark_size_mm: Annotated[float, Meta(gt=0, le=10)] = 8.0
    marks: Annotated[dict[str, Point], Meta(max_length=100)] = field(
        default_factory=lambda: dict(PAPER_MARKS)
    )
    stations_mm: Annotated[tuple[Place, ...], Meta(min_length=1, max_length=100)] = (
        7.0, 67.0, 127.0, 187.0,
    )  # fmt: skip
    approach_mm: Annotated[float, Meta(ge=5, le=50)] = 10.0


class RecordsTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where sessions are kept, how long, and how much room must be left."""

    state_dir: Named = "~/.local/state/legato"
    keep_days: Annotated[int, Meta(ge=1, le=36_500)] = 90
    keep_sessions: Annotated[int, Meta(ge=0, le=1_000_000)] = 20
    min_free_mb: Annotated[int, Meta(ge=0, le=10_000_000)] = 200


class MetricsTable(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where Prometheus may ask for the daemon's metrics; false is nowhere."""

    listen: str | bool = False


class SimTable(SimSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The simulated cell, and the faults that strike its drivers or any other."""

    faults: Annotated[tuple[FaultSettings, ...], Meta(max_length=100)] = ()


class Config(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The whole file."""

    server: ServerTable = ServerTable()
    robot: RobotTable = RobotTable()
    camera: CameraTable = CameraTable()
    cell: CellTable = CellTable()
    leg: LegTable = field(default_factory=LegTable)
    calibration: CalibrationSettings = CalibrationSettings()
    massage: MassageSettings = MassageSettings()
    records: RecordsTable = RecordsTable()
    metrics: MetricsTable = MetricsTable()
    sim: SimTable = SimTable()
