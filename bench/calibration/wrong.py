"""Marks that are wrong in the ways that picking and pasting go wrong, and what is accepted of them.

Accepted means what verify asks of one picture: the misfit within the noise, every held-out mark
within its limit, the stations known well enough, nothing on a bound.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bench.calibration.scenes import LEG, Scene
from legato.calibration.heldout import held_out
from legato.calibration.problem import CalibrationError, EngineSettings, Problem
from legato.calibration.robust import Robust, solve_robust

# As in legato's [calibration] by default.
MOST_HELD_OUT, MOST_STATION_SIGMA, MOST_RMS_PX = 4.0, 0.3, 0.5
MOST_ROTATION_DEG, MOST_STATION_MM = 1.0, 1.0

Spoil = Callable[[Problem, np.random.Generator], tuple[Problem, tuple[str, ...]]]


@dataclass(frozen=True)
class Verdict:
    """What came of one spoilt scene."""

    accepted: bool
    left_out: tuple[str, ...]
    bad: tuple[str, ...]
    rotation_deg: float
    station_mm: float

    @property
    def wrong(self) -> bool:
        """Whether a pose was accepted that is off by more than 1 deg or 1 mm at a station."""
        off = self.rotation_deg > MOST_ROTATION_DEG or self.station_mm > MOST_STATION_MM
        return self.accepted and off


def judge(
    scene: Scene, problem: Problem, bad: tuple[str, ...], seed: int, engine: str = "hybrid"
) -> Verdict:
    """Return what solving and testing make of a spoilt problem."""
    try:
        rng = np.random.default_rng(seed)
        found = solve_robust(problem, engine, EngineSettings(), rng)
    except CalibrationError:
        return Verdict(False, (), bad, np.inf, np.inf)
    turned, _ = scene.errors(found.solution.camera_from_object)
    off = scene.station_error(found.solution.camera_from_object)
    return Verdict(accepted(found), found.left_out, bad, turned, off)


def accepted(found: Robust) -> bool:
    """Say whether verify's tests of one picture pass."""
    s = found.solution
    rows = held_out(found.problem, s)
    return bool(
        found.suspects.misfit <= found.suspects.limit
        and s.rms_px <= MOST_RMS_PX
        and not s.on_bound
        and rows
        and max(r.ratio for r in rows) <= MOST_HELD_OUT
        and s.sigma_stations.max() <= MOST_STATION_SIGMA
    )


def relabelled(problem: Problem, order: np.ndarray) -> tuple[Problem, tuple[str, ...]]:
    """Return the problem with pixels (M, 2) dealt out in another order, and whose changed."""
    bad = tuple(
        n for n, i, j in zip(problem.names, order, range(len(order)), strict=True) if i != j
    )
    return replace(problem, pixels=problem.pixels[order]), bad


def swapped(problem: Problem, rng: np.random.Generator) -> tuple[Problem, tuple[str, ...]]:
    """Make two marks carry each other's name."""
    order = np.arange(len(problem.names))
    i, j = rng.choice(len(order), 2, replace=False)
    order[[i, j]] = order[[j, i]]
    return relabelled(problem, order)


def face_swapped(problem: Problem, rng: np.random.Generator) -> tuple[Problem, tuple[str, ...]]:
    """Make P1 and P8, the two on the big face, carry each other's name."""
    if not {"P1", "P8"} <= set(problem.names):
        return swapped(problem, rng)
    order = np.arange(len(problem.names))
    i, j = problem.names.index("P1"), problem.names.index("P8")
    order[[i, j]] = order[[j, i]]
    return relabelled(problem, order)


def cycled(problem: Problem, rng: np.random.Generator) -> tuple[Problem, tuple[str, ...]]:
    """Make three marks pass their names round."""
    order = np.arange(len(problem.names))
    three = rng.choice(len(order), 3, replace=False)
    order[three] = order[np.roll(three, 1)]
    return relabelled(problem, order)


def shuffled(problem: Problem, rng: np.random.Generator) -> tuple[Problem, tuple[str, ...]]:
    """Deal out all names at random."""
    return relabelled(problem, rng.permutation(len(problem.names)))


def mirrored(problem: Problem, rng: np.random.Generator) -> tuple[Problem, tuple[str, ...]]:
    """Take the two generators, and the two marks on the face, for each other."""
    del rng
    twin = {"P1": "P8", "P2": "P5", "P3": "P6", "P4": "P7", "P9": "P10"}
    twin |= {b: a for a, b in twin.items()}
    keep = [n for n in problem.names if twin[n] in problem.names]
    order = np.arange(len(problem.names))
    for n in keep:
        order[problem.names.index(n)] = problem.names.index(twin[n])
    return relabelled(problem, order)


def _mispicked(
    problem: Problem, rng: np.random.Generator, count: int
) -> tuple[Problem, tuple[str, ...]]:
    pixels = problem.pixels.copy()
    chosen = rng.choice(len(pixels), count, replace=False)
    for i in chosen:
        size = float(problem.sigma[i]) * np.exp(rng.uniform(np.log(2.0), np.log(400.0)))
        way = rng.uniform(-np.pi, np.pi)
        pixels[i] += size * np.array([np.cos(way), np.sin(way)])
    return replace(problem, pixels=pixels), tuple(problem.names[i] for i in chosen)


def mispicked(problem: Problem, rng: np.random.Generator) -> tuple[Problem, tuple[str, ...]]:
    """Let one mark be seen 2 to 400 sigma from where it is."""
    return _mispicked(problem, rng, 1)


def two_mispicked(problem: Problem, rng: np.random.Generator) -> tuple[Problem, tuple[str, ...]]:
    """Let two marks be seen 2 to 400 sigma from where they are."""
    return _mispicked(problem, rng, 2)


def three_mispicked(problem: Problem, rng: np.random.Generator) -> tuple[Problem, tuple[str, ...]]:
    """Let three marks be seen 2 to 400 sigma from where they are."""
    return _mispicked(problem, rng, 3)


def misplaced(problem: Problem, rng: np.random.Generator) -> tuple[Problem, tuple[str, ...]]:
    """Let one mark be pasted 0.2 to 20 mm from where its coordinates have it, along the surface."""
    name = str(rng.choice(problem.names))
    size = np.exp(rng.uniform(np.log(0.2), np.log(20.0)))
    way = rng.uniform(-np.pi, np.pi)
    place = LEG.mark_surface(name, size * np.array([np.cos(way), np.sin(way)]))
    points = problem.points.copy()
    points[problem.names.index(name)] = place
    return replace(problem, points=points), (name,)


def together(problem: Problem, rng: np.random.Generator) -> tuple[Problem, tuple[str, ...]]:
    """Let two or three neighbours be seen too far the same way, as by a shadow's edge."""
    count = int(rng.integers(2, 4))
    first = int(rng.integers(len(problem.names)))
    distance = np.linalg.norm(problem.pixels - problem.pixels[first], axis=1)
    chosen = np.argsort(distance)[:count]
    size = float(problem.sigma[0]) * np.exp(rng.uniform(np.log(2.0), np.log(100.0)))
    way = rng.uniform(-np.pi, np.pi)
    pixels = problem.pixels.copy()
    pixels[chosen] += size * np.array([np.cos(way), np.sin(way)])
    return replace(problem, pixels=pixels), tuple(problem.names[i] for i in chosen)


WAYS: dict[str, Spoil] = {
    "two labels swapped": swapped,
    "P1 and P8 swapped": face_swapped,
    "three labels passed round": cycled,
    "all labels shuffled": shuffled,
    "generators mistaken": mirrored,
    "one mark mispicked": mispicked,
    "two marks mispicked": two_mispicked,
    "three marks mispicked": three_mispicked,
    "one mark misplaced": misplaced,
    "neighbours off together": together,
}
