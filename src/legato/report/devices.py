"""Which of a cell's devices are simulated, in words: one is enough for a session not to be real."""

from collections.abc import Mapping
from typing import Any

DEVICES = {"arm", "camera"}
SIMULATED, REAL = "simulated", "real"


def cell(told: Mapping[str, Any]) -> str:
    """Return what kind of cell a session.json or a status tells of.

    It is "real", "simulated", "simulated arm" or "simulated camera"; records of earlier versions
    do not say which devices, and count as simulated throughout.
    """
    if not told.get("simulated"):
        return REAL
    devices = {str(d) for d in told.get("simulated_devices") or ()} & DEVICES
    return f"{SIMULATED} {devices.pop()}" if len(devices) == 1 else SIMULATED


def not_real(told: Mapping[str, Any]) -> str:
    """Return a sentence that says what of a session was not real, empty for a real cell."""
    match cell(told):
        case "simulated":
            return "No real arm moved and no real picture was taken: a simulated cell did all this."
        case "simulated camera":
            return "No real picture was taken: the camera was simulated, but a real arm moved."
        case "simulated arm":
            return "No real arm moved: the arm was simulated, and the pictures were real."
        case _:
            return ""


def badge(told: Mapping[str, Any]) -> str:
    """Return the same as a badge, empty for a real cell."""
    found = cell(told)
    return "" if found == REAL else found.upper()
