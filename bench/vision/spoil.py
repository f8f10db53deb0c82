"""What spoils a picture on its way to the file: covers, light, lens, motion, sensor, JPEG."""

from dataclasses import dataclass, field

import cv2
import numpy as np

from bench.vision.scenes import Sharp
from legato.geometry.transforms import Array
from legato.hal.camera import Image

EDGE = cv2.BORDER_REPLICATE


@dataclass(frozen=True)
class Cover:
    """A flat thing before the scene: corners (K, 2) px and a tone, 0 to 1."""

    corners: Array
    tone: float


@dataclass(frozen=True)
class Glare:
    """A bright reflection: centre (2,) px, radius px, and how much light it adds."""

    at: Array
    radius: float
    strength: float


@dataclass(frozen=True)
class Spoil:
    """One picture's conditions; the defaults are the simulated cell's.

    `motion` is the length (px) and direction (rad) of a straight blur, `slant` how far the light
    rises or falls across the picture (share, direction rad), `jpeg` a quality or None.
    """

    blur: float = 0.8
    noise: float = 2.0
    gain: float = 1.0
    motion: tuple[float, float] = (0.0, 0.0)
    slant: tuple[float, float] = (0.0, 0.0)
    covers: tuple[Cover, ...] = ()
    glares: tuple[Glare, ...] = ()
    jpeg: int | None = None
    defocus: float = field(default=0.0)  # radius px of a disc of confusion


def expose(sharp: Sharp, spoil: Spoil, rng: np.random.Generator) -> Image:
    """Return the 8-bit picture of a sharp one."""
    h, w = sharp.shape
    picture = np.asarray(sharp, dtype=np.float32).copy()
    v, u = np.mgrid[0:h, 0:w].astype(np.float32)
    if spoil.slant[0]:
        run = (u - w / 2) * np.cos(spoil.slant[1]) + (v - h / 2) * np.sin(spoil.slant[1])
        picture *= (1.0 + spoil.slant[0] * run / (w / 2)).clip(0.05).astype(np.float32)
    for glare in spoil.glares:
        away = np.hypot(u - glare.at[0], v - glare.at[1]) / glare.radius
        picture += (glare.strength / (1.0 + np.exp(np.minimum(6.0 * (away - 1.0), 40.0)))).astype(
            np.float32
        )
    for cover in spoil.covers:
        _lay(picture, cover)
    picture = _soft(cv2.GaussianBlur(picture, (0, 0), spoil.blur, borderType=EDGE))
    if spoil.defocus > 0.0:
        picture = _soft(cv2.filter2D(picture, -1, _disc(spoil.defocus), borderType=EDGE))
    if spoil.motion[0] > 0.0:
        picture = _soft(cv2.filter2D(picture, -1, _line(*spoil.motion), borderType=EDGE))
    noise = rng.standard_normal((h, w), dtype=np.float32) * np.float32(spoil.noise)
    image = np.clip(np.rint(picture * (255.0 * spoil.gain) + noise), 0, 255).astype(np.uint8)
    if spoil.jpeg is None:
        return np.asarray(image)
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, spoil.jpeg])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


def cover_over(at: Array, size: float, rng: np.random.Generator, offset: float = 0.0) -> Cover:
    """Return a turned quadrilateral of about `size` px about a place, off it by `offset` px."""
    turn, away = rng.uniform(0.0, 2.0 * np.pi, 2)
    angles = turn + np.arange(4) * np.pi / 2 + rng.uniform(-0.2, 0.2, 4)
    radii = size * rng.uniform(0.85, 1.25, 4)
    corners = at + radii[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    corners += offset * np.array([np.cos(away), np.sin(away)])
    return Cover(corners, float(rng.uniform(0.05, 0.95)))


def _soft(picture: object) -> Sharp:
    return np.asarray(picture, dtype=np.float32)


def _lay(picture: Sharp, cover: Cover) -> None:
    """Paint a cover into a picture, its edges area-sampled by eight."""
    mask = np.zeros(picture.shape, dtype=np.uint8)
    corners = np.rint(cover.corners * 256.0).astype(np.int32)
    cv2.fillPoly(mask, [corners.reshape(-1, 1, 2)], 255, cv2.LINE_AA, 8)
    share = mask.astype(np.float32) / 255.0
    picture += share * (np.float32(cover.tone) - picture)


def _disc(radius: float) -> Sharp:
    """Return a disc of confusion, edges area-sampled."""
    n = int(np.ceil(radius)) + 1
    y, x = np.mgrid[-n : n + 1, -n : n + 1]
    kernel = np.clip(radius + 0.5 - np.hypot(x, y), 0.0, 1.0)
    return np.asarray(kernel / kernel.sum(), dtype=np.float32)


def _line(length: float, angle: float) -> Sharp:
    """Return the kernel of a straight even motion, symmetrical about the middle."""
    n = int(np.ceil(length / 2)) + 2
    y, x = np.mgrid[-n : n + 1, -n : n + 1].astype(float)
    kernel = np.zeros_like(x)
    for s in np.linspace(-length / 2, length / 2, max(9, int(8 * length))):
        u, v = s * np.cos(angle), s * np.sin(angle)
        kernel += np.maximum(0, 1 - np.abs(x - u)) * np.maximum(0, 1 - np.abs(y - v))
    return np.asarray(kernel / kernel.sum(), dtype=np.float32)
