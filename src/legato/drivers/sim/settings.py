"""The `[sim]` table: what is true in the simulated world, which the daemon must find out."""

from typing import Annotated

from msgspec import Meta, Struct

Positive = Annotated[float, Meta(gt=0, le=100_000)]
NotNegative = Annotated[float, Meta(ge=0, le=1000)]
Place = Annotated[float, Meta(ge=-100_000, le=100_000)]
Turn = Annotated[float, Meta(ge=-3600, le=3600)]
Distortion = Annotated[float, Meta(ge=-100, le=100)]
Point = tuple[Place, Place, Place]


class SimSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Truth about leg, camera, tissue and arm; names are the configuration's keys."""

    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] = 1
    """Draws the leg's scatter, the marks' turn, and all noise."""
    time_scale: Annotated[float, Meta(gt=0, le=10_000)] = 20.0
    """Seconds of the cell in one second of the wall clock."""

    leg_at_mm: Point = (124.29, -64.03, 30.52)
    """The object frame's origin before scatter: the paper's published place."""
    leg_yaw_deg: Turn = 90.0
    """Heading of the leg's axis from the robot's x toward its y."""
    leg_rise_deg: Turn = 5.75
    """How far the axis rises toward the ankle."""
    leg_roll_deg: Turn = 0.0
    """Turn about the leg's own axis."""
    scatter_mm: NotNegative = 6.0
    """Largest random shift along x and y; a third of it along z."""
    scatter_deg: Annotated[float, Meta(ge=0, le=180)] = 5.0
    """Largest random yaw; a half of it for rise and roll."""

    camera_at_mm: Point = (228.6, -101.6, 50.8)
    camera_looks_at_mm: Point = (126.0, -11.0, 36.0)
    alpha_u: Positive = 652.0
    alpha_v: Positive = 655.0
    u0: Place = 346.0
    v0: Place = 279.0
    k1: Distortion = -0.02
    k2: Distortion = 0.0
    blur_px: Annotated[float, Meta(ge=0, le=100)] = 0.8
    """Standard deviation of the lens's and sensor's blur."""
    noise: Annotated[float, Meta(ge=0, le=255)] = 2.0
    """Standard deviation of each pixel's grey level, of 255."""
    picture_s: Annotated[float, Meta(gt=0, le=60)] = 0.04
    """Time from asking for a picture to having it."""
    mark_turn_deg: Annotated[float, Meta(ge=0, le=180)] = 10.0
    """Largest turn with which a hand pasted a mark on."""

    tissue_n_per_mm: Positive = 2.0
    table_n_per_mm: Positive = 50.0
    switch_n: Positive = 0.3
    """Force at which the grip switch closes."""
    stall_n: Positive = 12.0
    """Force at the fingertip beyond which motors lose steps."""
    backlash_steps: NotNegative = 4.0
    """Play of motors 1 to 5 in half-steps, taken up at the start as if each had moved forward."""
    arm_at_mm: Point = (127.0, 0.0, 150.0)
    """Where the fingertip truly stands when the cell is switched on."""
    arm_pitch_deg: Turn = -90.0
    arm_roll_deg: Turn = 0.0
