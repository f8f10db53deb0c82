"""The figures of the explanation, by name. Each is drawn once, by code, from the project's own."""

from collections.abc import Callable
from functools import lru_cache

from docs.gen.figures import known, motion, search, space

FIGURES: dict[str, Callable[[], str]] = {
    "frames": space.frames,
    "leg": space.leg,
    "arm": space.arm,
    "residuals": known.residuals,
    "bound": known.bound,
    "convergence": search.convergence,
    "operators": search.operators,
    "chord": motion.chord,
    "stroke": motion.stroke,
    "lead-in": motion.lead_in,
    "states": motion.states,
}


@lru_cache(maxsize=32)
def drawn(name: str) -> str:
    """Return a figure as SVG. KeyError for one that does not exist."""
    return FIGURES[name]()
