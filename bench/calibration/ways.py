"""Every way from marks to a pose under one signature, legato's engines and the peers alike."""

from collections.abc import Callable

import numpy as np

from bench.calibration.peers import PEERS, Answer, Peer
from bench.calibration.scenes import Scene
from legato.calibration.problem import EngineSettings
from legato.calibration.solve import solve

SETTINGS = EngineSettings()
OURS = ("hybrid", "separable")
EVOLUTION, SHORT_EVOLUTION = "scipy DE + LM", "scipy DE, 100 generations, + LM"
# So slow that they get fewer scenes.
SLOW = ("paper", EVOLUTION, SHORT_EVOLUTION)


def engine(name: str) -> Peer:
    """Return one of legato's engines as a peer."""

    def run(scene: Scene, known: bool, seed: int) -> Answer | None:
        if known and name == "paper":
            return None
        rng = np.random.default_rng(seed)
        found = solve(scene.of(known), name, SETTINGS, rng)
        return Answer(found.intrinsics, found.camera_from_object, found.cost)

    return run


WAYS: dict[str, Callable[[Scene, bool, int], Answer | None]] = {
    "hybrid": engine("hybrid"),
    "separable": engine("separable"),
    "paper": engine("paper"),
    **PEERS,
}
