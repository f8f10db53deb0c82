"""A case: two pictures, what the cell believes, and what is true."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from bench.vision.scenes import Truth, settings, sharp, true_camera
from bench.vision.spoil import Spoil, expose
from legato.control.settings import CellSettings
from legato.hal.camera import Image


@dataclass(frozen=True)
class Case:
    """Two pictures, what the cell believes, and where the leg lies at the second (None: no leg)."""

    first: Image
    second: Image
    settings: CellSettings
    truth: Truth | None
    other: Truth | None = None  # a leg that may be found as well
    picks: Mapping[str, tuple[float, float]] | None = None  # a person's


Draw = Callable[[np.random.Generator], Case]


def shown(
    truth: Truth, spoil: Spoil, rng: np.random.Generator, believed: CellSettings | None = None
) -> Case:
    """Return the case of a leg that stands still, taken twice under the same conditions."""
    scene = sharp(truth, true_camera())
    first, second = (expose(scene, spoil, rng) for _ in range(2))
    return Case(first, second, believed or settings(), truth)


def usual(rng: np.random.Generator) -> Spoil:
    """Draw a sound picture's lens and sensor."""
    return Spoil(
        blur=rng.uniform(0.6, 1.1), noise=rng.uniform(1.0, 3.0), gain=rng.uniform(0.8, 1.1)
    )
