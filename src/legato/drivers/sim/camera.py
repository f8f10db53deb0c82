"""The simulated camera: it renders the true leg, with new noise in each picture."""

from functools import cached_property
from typing import TYPE_CHECKING

from legato.drivers.sim.world import World
from legato.geometry.projection import Intrinsics
from legato.geometry.transforms import invert
from legato.hal.camera import Frame
from legato.hal.faults import Cause, DeviceError

if TYPE_CHECKING:
    from legato.drivers.sim.render import Renderer


class SimCamera:
    """A camera that stands in a simulated world, `width` x `height` px."""

    def __init__(self, world: World, width: int = 768, height: int = 576) -> None:
        self._world = world
        self._width, self._height = width, height
        self._sequence = 0
        self._open = False

    @cached_property
    def _renderer(self) -> "Renderer":
        """What makes the pictures; loaded with the first of them, since it takes 50 MB."""
        from legato.drivers.sim.render import Renderer, paste_marks

        world, s = self._world, self._world.settings
        return Renderer(
            world.leg,
            Intrinsics(s.alpha_u, s.alpha_v, s.u0, s.v0, s.k1, s.k2, self._width, self._height),
            paste_marks(world.leg, s.mark_turn_deg, world.marks_rng),
            blur=s.blur_px,
            noise=s.noise,
            table_z=world.table_z,
        )

    @property
    def simulated(self) -> bool:
        """True: the pictures are rendered."""
        return True

    def open(self) -> None:
        """Connect; nothing is rendered before the first grab."""
        self._open = True

    def close(self) -> None:
        """Let go of the camera."""
        self._open = False

    def grab(self) -> Frame:
        """Return a picture of the leg as it truly lies. Raises DeviceError (camera_lost)."""
        if not self._open:
            raise DeviceError(
                Cause.CAMERA_LOST, "the simulated camera is not open", "open it before it is used"
            )
        world = self._world
        due = world.clock.monotonic() + world.settings.picture_s
        camera_from_world = invert(world.world_from_camera)
        camera_from_object = camera_from_world @ world.world_from_object
        image = self._renderer.render(camera_from_object, camera_from_world, world.noise_rng)
        # The time that the computing took is part of the picture's, and not its age: a quick clock
        # would make every picture stale.
        world.clock.sleep(due - world.clock.monotonic())
        self._sequence += 1
        return Frame(image, world.settings.picture_s, self._sequence, "simulated camera")
