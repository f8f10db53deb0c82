"""What truly happened in the simulated world: touches of the fingertip, and breaches.

A touch begins where the fingertip's clearance crosses zero and ends where it leaves. A breach is
anything that must not happen: see `World`. The latest thousands are kept: a cell runs for months.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from legato.geometry.motion import Steps
from legato.geometry.transforms import Array

KEPT = 2000  # of each kind: far more than one session has


@dataclass(frozen=True)
class Walk:
    """Samples along one command: done `fractions` (N,) of it, `times` (N,) and tips (N, 3)."""

    fractions: Array
    times: Array
    tips: Array
    registers: Callable[[float], Steps]

    def between(self, index: int, share: float) -> tuple[float, float, Array]:
        """Return fraction, time and tip `share` of the way from one sample to the next."""
        a, b = index, min(index + 1, len(self.fractions) - 1)
        fraction = (1.0 - share) * self.fractions[a] + share * self.fractions[b]
        time = (1.0 - share) * self.times[a] + share * self.times[b]
        return float(fraction), float(time), (1.0 - share) * self.tips[a] + share * self.tips[b]


@dataclass
class Touch:
    """One touch of the fingertip: where it began, how deep and how hard it became."""

    surface: str
    began_s: float
    world: Array
    in_object: Array
    registers: Steps
    depth: float = 0.0
    force: float = 0.0
    switch_s: float | None = None
    switch_registers: Steps | None = None
    ended_s: float | None = None

    def as_json(self) -> dict[str, object]:
        """Return the touch as JSON-able data; the angle is about the leg's axis."""
        x, y, z = (float(v) for v in self.in_object)
        return {
            "surface": self.surface,
            "began_s": self.began_s,
            "ended_s": self.ended_s,
            "world_mm": [float(v) for v in self.world],
            "object_mm": [x, y, z],
            "along_mm": x,
            "angle_deg": float(np.degrees(np.arctan2(-y, z))),
            "depth_mm": self.depth,
            "force_n": self.force,
            "registers": list(self.registers),
            "switch_s": self.switch_s,
            "switch_registers": None if self.switch_registers is None else [*self.switch_registers],
        }


class Contact:
    """The fingertip against one surface that yields: its touches so far."""

    def __init__(self, surface: str, n_per_mm: float, switch_n: float) -> None:
        self._surface = surface
        self._n_per_mm = n_per_mm
        self._switch_n = switch_n
        self._open: Touch | None = None
        self.touches: deque[Touch] = deque(maxlen=KEPT)

    def forces(self, clearances: Array) -> Array:
        """Return the surface's push (...) on the fingertip at clearances (...)."""
        return self._n_per_mm * np.maximum(0.0, -clearances)

    def follow(self, walk: Walk, clearances: Array, object_from_world: Array) -> None:
        """Note every touch along a walk whose samples have `clearances` (N,)."""
        inside = clearances < 0.0
        if self._open is not None and not inside[0]:
            self._end(float(walk.times[0]))
        if self._open is None and inside[0]:
            self._begin(walk, 0, 0.0, object_from_world)
        first = 0
        for index in np.flatnonzero(inside[1:] != inside[:-1]):
            before, after = clearances[index], clearances[index + 1]
            share = float(before / (before - after))
            if inside[index]:
                self._press(walk, clearances, first, int(index) + 1)
                self._end(walk.between(int(index), share)[1])
            else:
                self._begin(walk, int(index), share, object_from_world)
                first = int(index) + 1
        self._press(walk, clearances, first, len(clearances))

    def _begin(self, walk: Walk, index: int, share: float, object_from_world: Array) -> None:
        """Open a touch between two samples."""
        fraction, time, tip = walk.between(index, share)
        place = object_from_world[:3, :3] @ tip + object_from_world[:3, 3]
        self._open = Touch(self._surface, time, tip, place, walk.registers(fraction))
        self.touches.append(self._open)

    def _press(self, walk: Walk, clearances: Array, first: int, last: int) -> None:
        """Take samples `first` to `last` into the open touch, if there is one."""
        if self._open is None:
            return
        forces = self.forces(clearances[first:last])
        self._open.depth = max(self._open.depth, float(-clearances[first:last].min()))
        self._open.force = max(self._open.force, float(forces.max()))
        if self._open.switch_s is None and self._open.force >= self._switch_n:
            index = first + int(np.argmax(forces >= self._switch_n))
            self._open.switch_s = float(walk.times[index])
            self._open.switch_registers = walk.registers(float(walk.fractions[index]))

    def _end(self, time: float) -> None:
        """Close the open touch."""
        if self._open is not None:
            self._open.ended_s = time
        self._open = None


@dataclass
class Ledger:
    """Breaches in the order in which they happened."""

    breaches: deque[dict[str, object]] = field(default_factory=lambda: deque(maxlen=KEPT))

    def breach(self, kind: str, what: str, where: Array, when: float) -> None:
        """Keep one breach: its kind, a sentence, a place in the world and a time."""
        self.breaches.append(
            {"kind": kind, "what": what, "world_mm": [float(v) for v in where], "t_s": when}
        )
