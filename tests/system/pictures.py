"""Pictures that no search can settle and a person can: two legs in sight."""

from pathlib import Path

import numpy as np

from legato.config.load import load
from legato.drivers.sim.render import Renderer, paste_marks
from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, project, undistort
from legato.geometry.raycast import cast, object_rays
from legato.geometry.transforms import Array, invert, look_at, transform
from legato.vision.picture import encode_png

CAMERA_AT, LOOKS_AT = [350.0, -210.0, 120.0], [126.0, 0.0, 80.0]
HIGHER = 95.0  # mm, of the second leg over the one on the table
RISE = np.radians(5.75)


def two_legs(folder: Path) -> tuple[str, dict[str, tuple[float, float]]]:
    """Write two pictures of two legs; return their pattern and where the lower one's marks are."""
    sim, leg, rng = load().config.sim, Leg(), np.random.default_rng(0)
    camera = Intrinsics(sim.alpha_u, sim.alpha_v, sim.u0, sim.v0, sim.k1, sim.k2)
    camera_from_world = invert(look_at(CAMERA_AT, LOOKS_AT))
    poses = [camera_from_world @ _lying(height) for height in (31.0, 31.0 + HIGHER)]
    drawn = [Renderer(leg, camera, paste_marks(leg, 8.0, rng), table_z=0.0) for _ in poses]
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
    second = cast(leg, *object_rays(poses[1], undistort(camera, np.stack([u, v], axis=-1)))).hit
    for number in (1, 2):
        lower, upper = (
            d.render(pose, camera_from_world, rng) for d, pose in zip(drawn, poses, strict=True)
        )
        picture = np.where(second, upper, lower).astype(np.uint8)
        (folder / f"view-{number:02d}.png").write_bytes(encode_png(picture))
    pixels = project(camera, poses[0], leg.points(leg.names()))
    marks = {n: (float(u), float(v)) for n, (u, v) in zip(leg.names(), pixels, strict=True)}
    return str(folder / "view-%02d.png"), marks


def _lying(height: float) -> Array:
    """Return the pose of a leg along the robot's y, `height` mm up, rising as the paper's does."""
    cos, sin = np.cos(RISE), np.sin(RISE)
    rotation = np.array([[0.0, -1.0, 0.0], [cos, 0.0, -sin], [sin, 0.0, cos]])
    return transform(rotation, [124.0, -64.0, height])
