"""Rendered pictures whose truth is known, for all tests of vision."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from legato.drivers.sim.render import Renderer, paste_marks
from legato.drivers.sim.settings import SimSettings
from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics
from legato.geometry.transforms import Array, invert, look_at, rotation_from_vector, transform
from legato.vision.picture import Grey
from legato.vision.view import View


@dataclass(frozen=True)
class Scene:
    """One picture and the view that made it."""

    image: Grey
    view: View
    leg: Leg

    def truth(self, name: str) -> Array:
        """Return the pixel (2,) of a mark."""
        return np.asarray(self.view.pixels(self.leg.points((name,)))[0])

    def seen(self, margin: float = 12.0) -> list[str]:
        """Return the marks in sight and inside the picture."""
        hidden = self.view.unseen(self.leg, margin)
        return [n for n in self.leg.names() if n not in hidden]


@pytest.fixture(scope="session")
def draw() -> Callable[..., Scene]:
    """Render the scene of a seed: pose scattered as the simulated cell's, marks turned anew."""
    s, leg = SimSettings(), Leg()
    camera = Intrinsics(s.alpha_u, s.alpha_v, s.u0, s.v0, s.k1, s.k2)
    camera_from_world = invert(look_at(s.camera_at_mm, s.camera_looks_at_mm))

    def render(seed: int, *, blur: float = 0.8, noise: float = 2.0, scatter: float = 1.0) -> Scene:
        rng = np.random.default_rng(seed)
        yaw = np.radians(s.leg_yaw_deg + scatter * rng.uniform(-5.0, 5.0))
        rise = np.radians(s.leg_rise_deg + scatter * rng.uniform(-2.5, 2.5))
        roll = np.radians(s.leg_roll_deg + scatter * rng.uniform(-2.5, 2.5))
        x = np.array([np.cos(rise) * np.cos(yaw), np.cos(rise) * np.sin(yaw), np.sin(rise)])
        y = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
        level = np.stack([x, y, np.cross(x, y)], axis=1)
        at = np.asarray(s.leg_at_mm) + scatter * rng.uniform(-1, 1, 3) * [6.0, 6.0, 2.0]
        world_from_object = transform(level @ rotation_from_vector([roll, 0.0, 0.0]), at)
        pose = camera_from_world @ world_from_object
        marks = paste_marks(leg, s.mark_turn_deg, rng)
        renderer = Renderer(leg, camera, marks, blur=blur, noise=noise)
        return Scene(renderer.render(pose, camera_from_world, rng), View(camera, pose), leg)

    return render


@pytest.fixture(scope="session")
def plain(draw: Callable[..., Scene]) -> Scene:
    """Render the scene of the simulated cell without scatter: all ten marks in sight."""
    return draw(0, scatter=0.0)
