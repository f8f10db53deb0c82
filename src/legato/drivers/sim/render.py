"""The simulated camera's pictures: the leg with its pasted marks on a table, ray-cast.

Every pixel is an area sample: 4x4 rays near marks and outlines, one elsewhere, and a mark's edge
is a ramp as wide as a ray's own footprint, so that edges lie right to a hundredth of a pixel.
Then follow the lens's blur, the sensor's noise and 8 bits.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from legato.drivers.sim.surroundings import Light, Surroundings
from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, project, undistort
from legato.geometry.raycast import MISS, Hits, cast, object_rays
from legato.geometry.transforms import Array, apply, invert
from legato.hal.camera import Image

PAPER_WHITE, INK = 0.92, 0.07
WOOD, GRAIN = 0.5, 0.05
FINE = 4  # rays along each side of a finely sampled pixel
BAND_ROWS = 96  # rows cast at a time, which bounds the memory


@dataclass(frozen=True)
class PastedMark:
    """How a hand pasted one mark on: its turn in rad and which diagonal is dark (1 or -1)."""

    turn: float = 0.0
    parity: int = 1


def paste_marks(leg: Leg, turn_deg: float, rng: np.random.Generator) -> dict[str, PastedMark]:
    """Draw each mark's turn, at most `turn_deg` either way, and its dark diagonal."""
    limit = np.radians(turn_deg)
    return {
        name: PastedMark(float(rng.uniform(-limit, limit)), int(rng.choice([-1, 1])))
        for name in leg.names()
    }


class Renderer:
    """A camera's pictures of one leg; the last pose is kept, so a still scene costs only noise.

    `marks` says how each mark was pasted (marks not named are absent), `blur` is a standard
    deviation in px, `noise` one in grey levels, `table_z` the table's height in the world in mm.
    """

    def __init__(
        self,
        leg: Leg,
        intrinsics: Intrinsics,
        marks: Mapping[str, PastedMark],
        *,
        light: Light | None = None,
        blur: float = 0.8,
        noise: float = 2.0,
        table_z: float = 0.0,
    ) -> None:
        self._leg = leg
        self._intrinsics = intrinsics
        self._marks = dict(marks)
        self._light = light if light is not None else Light()
        self._blur = blur
        self._noise = noise
        v, u = np.mgrid[0 : intrinsics.height, 0 : intrinsics.width].astype(float)
        self._normalised = undistort(intrinsics, np.stack([u, v], axis=-1))
        self._surroundings = Surroundings(leg, self._light, self._normalised, table_z)
        self._key = b""
        self._clean: NDArray[np.float32] = np.zeros(u.shape, dtype=np.float32)

    def render(
        self,
        camera_from_object: ArrayLike,
        camera_from_world: ArrayLike,
        rng: np.random.Generator,
    ) -> Image:
        """Return one grey picture (H, W); `rng` draws its noise. Poses are 4x4 in mm."""
        clean = self.clean(camera_from_object, camera_from_world)
        noise = rng.standard_normal(clean.shape, dtype=np.float32) * np.float32(self._noise)
        return np.asarray(np.clip(np.rint(clean + noise), 0.0, 255.0), dtype=np.uint8)

    def clean(
        self, camera_from_object: ArrayLike, camera_from_world: ArrayLike
    ) -> NDArray[np.float32]:
        """Return the picture (H, W) in grey levels before noise and rounding."""
        pose = np.asarray(camera_from_object, dtype=float)
        world = np.asarray(camera_from_world, dtype=float)
        key = pose.tobytes() + world.tobytes()
        if key != self._key:
            sharp = self.sharp(pose, world)
            self._clean = np.asarray(_blurred(sharp * 255.0, self._blur), dtype=np.float32)
            self._key = key
        return self._clean

    def scenery(
        self, camera_from_object: ArrayLike, camera_from_world: ArrayLike
    ) -> NDArray[np.float32]:
        """Return what lies around the leg, with its shadow, as reflectance times light."""
        world = np.asarray(camera_from_world, dtype=float)
        return self._surroundings.picture(world, invert(camera_from_object) @ world)

    def sharp(
        self,
        camera_from_object: ArrayLike,
        camera_from_world: ArrayLike,
        behind: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Return the sharp picture (H, W) as reflectance times light, 0 to about 1.

        The leg is laid over `behind`, by default its own scenery.
        """
        pose = np.asarray(camera_from_object, dtype=float)
        world = np.asarray(camera_from_world, dtype=float)
        lamp = (invert(pose) @ world)[:3, :3] @ self._light.direction()
        picture = self.scenery(pose, world) if behind is None else behind.copy()
        rows, columns = self._box(pose)
        part = np.zeros(picture.shape, dtype=np.int8)
        for top in range(rows.start, rows.stop, BAND_ROWS):
            band = (slice(top, min(top + BAND_ROWS, rows.stop)), columns)
            hits = cast(self._leg, *object_rays(pose, self._normalised[band]))
            part[band] = hits.part
            shade = self._shade(hits, lamp, footprint=None)
            picture[band] = np.where(hits.hit, shade, picture[band])
        fine = np.argwhere(self._needs_fine(pose, part))
        for block in np.array_split(fine, max(1, len(fine) // 6000)):
            v, u = block.T
            picture[v, u] = self._fine_pixels(pose, lamp, v, u, picture[v, u])
        return picture

    def _box(self, pose: Array) -> tuple[slice, slice]:
        """Return the rows and columns that can show the leg."""
        i = self._intrinsics
        angle = np.linspace(0.0, 2.0 * np.pi, 65)
        outline = np.concatenate([self._leg.surface_point(x, angle) for x in (0, self._leg.length)])
        if apply(pose, outline)[:, 2].min() < 10.0:
            return slice(0, i.height), slice(0, i.width)
        pixels = project(i, pose, outline)
        low = np.floor(pixels.min(axis=0)).astype(int) - 3
        high = np.ceil(pixels.max(axis=0)).astype(int) + 4
        u = np.clip([low[0], high[0]], 0, i.width)
        v = np.clip([low[1], high[1]], 0, i.height)
        return slice(int(v[0]), int(v[1])), slice(int(u[0]), int(u[1]))

    def _needs_fine(self, pose: Array, part: NDArray[np.int8]) -> NDArray[np.bool_]:
        """Say which pixels lie on an outline or near a mark."""
        values = part.astype(np.uint8)
        edge = cv2.dilate(values, np.ones((3, 3))) != cv2.erode(values, np.ones((3, 3)))
        near = np.zeros(part.shape, dtype=np.uint8)
        half = self._leg.mark_size / 2.0
        ring = np.linspace(-half, half, 9)
        side = np.concatenate([np.stack(np.broadcast_arrays(s, ring), -1) for s in (-half, half)])
        square = np.concatenate([side, side[:, ::-1]])
        for name, mark in self._marks.items():
            corners = self._leg.mark_surface(name, square @ _turn(mark.turn))
            with np.errstate(invalid="ignore"):
                pixels = project(self._intrinsics, pose, corners)
            if np.isfinite(pixels).all() and np.abs(pixels).max() < 1e4:
                hull = cv2.convexHull(np.rint(pixels).astype(np.int32))
                cv2.fillConvexPoly(near, hull, 1)
        wide = np.asarray(cv2.dilate(near, np.ones((7, 7))), dtype=bool)
        return np.asarray(edge | (wide & (part != MISS)))

    def _fine_pixels(
        self, pose: Array, lamp: Array, v: NDArray[np.intp], u: NDArray[np.intp], behind: ArrayLike
    ) -> Array:
        """Return the mean over 4x4 rays of each pixel (v, u); misses show what lies `behind`."""
        n = self._normalised
        # Distortion is linear over one pixel to 1e-5 px: step with its local derivative.
        du = (n[v, np.minimum(u + 1, n.shape[1] - 1)] - n[v, np.maximum(u - 1, 0)]) / (
            np.minimum(u + 1, n.shape[1] - 1) - np.maximum(u - 1, 0)
        )[:, None]
        dv = (n[np.minimum(v + 1, n.shape[0] - 1), u] - n[np.maximum(v - 1, 0), u]) / (
            np.minimum(v + 1, n.shape[0] - 1) - np.maximum(v - 1, 0)
        )[:, None]
        step = (np.arange(FINE) + 0.5) / FINE - 0.5
        samples = (
            n[v, u][:, None, None]
            + step[None, :, None, None] * dv[:, None, None]
            + step[None, None, :, None] * du[:, None, None]
        )
        hits = cast(self._leg, *object_rays(pose, samples))
        shade = self._shade(hits, lamp, footprint=FINE)
        back = np.asarray(behind, dtype=float)[:, None, None]
        return np.asarray(np.where(hits.hit, shade, back).mean(axis=(1, 2)))

    def _shade(self, hits: Hits, lamp: Array, footprint: int | None) -> Array:
        """Return reflectance times light of hits; marks only where samples are fine."""
        p = hits.points
        albedo = WOOD + GRAIN * _grain(p)
        if footprint is not None:
            for name, mark in self._marks.items():
                _paste(self._leg, name, mark, p, albedo)
        with np.errstate(invalid="ignore"):
            return albedo * self._light.on(hits.normals, lamp)


def _paste(leg: Leg, name: str, mark: PastedMark, points: Array, albedo: Array) -> None:
    """Lay one mark over the `albedo` (P, n, n) of fine samples `points` (P, n, n, 3)."""
    half = leg.mark_size / 2.0
    centre = np.asarray(leg.marks[name])
    middle = points[:, FINE // 2, FINE // 2]
    with np.errstate(invalid="ignore"):
        near = np.linalg.norm(middle - centre, axis=-1) < leg.mark_size
    chosen = np.flatnonzero(near)
    x = points[chosen, ..., 0]
    own = np.abs(x) < 1e-9 if leg.on_face(name) else x > 1e-9
    chosen = chosen[own.all(axis=(1, 2))]
    if not chosen.size:
        return
    c = leg.mark_coordinates(name, points[chosen]) @ _turn(mark.turn).T
    rows = (c[:, -1] - c[:, 0]).mean(axis=1) / (FINE - 1)
    columns = (c[:, :, -1] - c[:, :, 0]).mean(axis=1) / (FINE - 1)
    width = np.hypot(rows, columns)[:, None, None]
    sign = np.clip(2.0 * c / width, -1.0, 1.0).prod(axis=-1) * mark.parity
    inside = np.clip(0.5 + (half - np.abs(c)) / width, 0.0, 1.0).prod(axis=-1)
    paper = (PAPER_WHITE + INK) / 2.0 + (PAPER_WHITE - INK) / 2.0 * sign
    albedo[chosen] += inside * (paper - albedo[chosen])


def _turn(angle: float) -> Array:
    """Return the matrix that takes developed coordinates into the turned mark's own."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def _grain(p: Array) -> Array:
    """Return the wood's figure in [-1, 1] at object points (..., 3): wavy rings of a turned log."""
    x, y, z = p[..., 0], p[..., 1], p[..., 2]
    rings = np.hypot(y - 9.0, z + 5.0) + 1.2 * np.sin(0.045 * x) + 0.02 * x
    return np.asarray(0.7 * np.sin(2.1 * rings) + 0.3 * np.sin(0.9 * rings + 0.11 * x))


def _blurred(picture: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Return the picture after a Gaussian blur of `sigma` px."""
    if sigma <= 0.0:
        return picture
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE))
