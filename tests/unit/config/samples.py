"""A configuration to break, and a camera that fits it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from legato.calibration.problem import KnownIntrinsics
from legato.geometry.projection import Intrinsics

SIM = """
[camera]
intrinsics = "lens.toml"

[cell]
camera_at_mm = [228.6, -101.6, 50.8]
camera_looks_at_mm = [126.0, -4.0, 36.0]
"""

Write = Callable[[str], Path]


def known(width: int = 768, height: int = 576) -> KnownIntrinsics:
    """Return a camera with a covariance that is not diagonal."""
    lens = Intrinsics(652.0, 655.0, 346.0, 279.0, -0.02, 0.001, width, height)
    root = np.diag([0.8, 0.8, 0.5, 0.4, 1e-3, 2e-3])
    root[1, 0] = 0.3
    return KnownIntrinsics(lens, root @ root.T)
