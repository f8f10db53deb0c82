"""The arm for the page's 3-D view: joints and links by our own kinematics, from where it stands.

The daemon tells the fingertip's pose; the elbow is up, as the arm's limits have it, so that the
pose gives every joint.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from legato.geometry.arm import ArmModel, backward, skeleton


def posed(model: ArmModel, arm: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the daemon says of the arm, with `joints_deg` and `links_mm`.

    The links are shoulder, elbow, wrist and fingertip [x, y, z] in the robot base frame. Both are
    None where nobody knows where the arm stands.
    """
    told = dict(arm) | {"joints_deg": None, "links_mm": None}
    if arm.get("xyz_mm") is None:
        return told
    pitch, roll = np.radians([arm["pitch_deg"], arm["roll_deg"]])
    joints = backward(model, arm["xyz_mm"], pitch, roll)
    if np.isfinite(joints).all():
        told["joints_deg"] = np.degrees(joints).round(3).tolist()
        told["links_mm"] = skeleton(model, joints).round(3).tolist()
    return told
