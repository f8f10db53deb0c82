"""What a calibration is given and what it gives: problem, settings and solution as plain data.

Genes, in this order everywhere (paper section 3.1, regrouped):
f, s_x, s_y, u0, v0, t_x, t_y, t_z (mm), omega, phi, kappa (rad).
f, s_x and s_y are not separately observable: only alpha_u = f s_x and alpha_v = f s_y are.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from legato.geometry.projection import Intrinsics
from legato.geometry.transforms import Array, rotation_from_angles, transform

GENES = ("f", "s_x", "s_y", "u0", "v0", "t_x", "t_y", "t_z", "omega", "phi", "kappa")

# Paper table 5.3 (t_y's bounds in order).
PAPER_BOUNDS: Mapping[str, tuple[float, float]] = {
    "f": (3.0, 25.0),
    "s_x": (90.0, 250.0),
    "s_y": (90.0, 250.0),
    "u0": (280.0, 360.0),
    "v0": (210.0, 320.0),
    "t_x": (-150.0, 150.0),
    "t_y": (-200.0, 200.0),
    "t_z": (0.0, 300.0),
    "omega": (-np.pi, np.pi),
    "phi": (-np.pi, np.pi),
    "kappa": (-np.pi, np.pi),
}


@dataclass(frozen=True)
class KnownIntrinsics:
    """A calibrated camera and what is known of its error.

    `covariance` is 6x6 over alpha_u, alpha_v, u0, v0 (px), k1, k2; zeros mean exactly known.
    """

    intrinsics: Intrinsics
    covariance: Array = field(default_factory=lambda: np.zeros((6, 6)))


@dataclass(frozen=True)
class Problem:
    """Marks on the leg and in the picture.

    `names` (M), `points` (M, 3) mm in the object frame, `pixels` (M, 2) px as seen (distorted),
    `sigma` (M,) standard deviation of each pixel coordinate. `known` is None where the intrinsics
    are to be estimated too, within `bounds` and without distortion.
    """

    names: tuple[str, ...]
    points: Array
    pixels: Array
    sigma: Array
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=lambda: PAPER_BOUNDS)
    known: KnownIntrinsics | None = None
    stations: Array = field(default_factory=lambda: np.zeros((0, 3)))  # (S, 3), object frame
    size: tuple[int, int] = (768, 576)  # width and height of the picture in px


def go_on() -> None:
    """Let a search go on."""


@dataclass(frozen=True)
class EngineSettings:
    """Settings of the genetic search.

    The paper names no population, rates, c, a or eta: these are ours, measured best. `heed` is
    called before each generation; what it raises ends the search.
    """

    population: int = 200
    generations: int = 2000
    crossover_rate: float = 0.8
    mutation_rate: float = 0.1
    mutation_scale: float = 1.0  # c
    mutation_horizon: float = 1.0  # a, in [1, 1.5]
    ranking_pressure: float = 2.0  # eta, in (1, 2]
    elites: int = 2
    stall_generations: int = 200  # stop when the six pose genes stay constant so long
    stall_tolerance: float = 1e-6
    search_population: int = 60  # hybrid: the short search before refinement
    search_generations: int = 15
    search_elites: int = 12
    heed: Callable[[], None] = go_on


@dataclass(frozen=True)
class Trace:
    """Best and mean cost (sum of squared px) by generation."""

    best: tuple[float, ...] = ()
    mean: tuple[float, ...] = ()


@dataclass(frozen=True)
class Solution:
    """One estimate of camera and pose with what is known of its error.

    `genes` (11,) has f, s_x, s_y as searched (known intrinsics: f = 1, s_x = alpha_u).
    `covariance` is over alpha_u, alpha_v, u0, v0, rotation vector (rad, in the camera frame,
    left-multiplied), translation (mm): 10x10; rows of what was known exactly are zero.
    Sigmas are one standard deviation: rotation in rad and translation in mm are the root of the
    trace, `sigma_stations` (S,) mm likewise for each station's place in the camera frame.
    """

    engine: str
    names: tuple[str, ...]
    genes: Array
    intrinsics: Intrinsics
    camera_from_object: Array
    cost: float
    rms_px: float
    residuals: Array  # (M, 2) px, predicted minus seen
    covariance: Array
    sigma_rotation: float
    sigma_translation: float
    sigma_stations: Array
    agreement: float  # share of refined elites that reached the same optimum; 1 certifies it
    on_bound: tuple[str, ...]  # genes that sit on their bound
    trace: Trace
    generations: int
    stopped_by: str  # "converged", "stalled" or "generations"


def pose_of(genes: Array) -> Array:
    """Return camera_from_object (..., 4, 4) of genes (..., 11)."""
    return transform(rotation_from_angles(genes[..., 8:11]), genes[..., 5:8])


class CalibrationError(ValueError):
    """Marks from which no pose can be trusted; says why, and in `hint` what to do."""

    def __init__(self, text: str, hint: str = "") -> None:
        self.text = text
        self.hint = hint
        super().__init__(f"{text} ({hint})" if hint else text)
