"""A cell as `legato watch` sees it."""

from typing import Any

from legato.cli.live import Live

STATES = ("idle", "capture", "calibrate", "verify", "move_home", "massage_7", "massage_67",
          "paused", "stopping", "fault")  # fmt: skip
ARM = {"connected": True, "referenced": True, "xyz_mm": [127.0, -2.5, 60.0], "pitch_deg": -90.0,
       "roll_deg": 0.0, "contact": False}  # fmt: skip


def status(state: str = "idle", boot: str = "b1", **more: Any) -> dict[str, Any]:
    """Return what a daemon answers to `status`."""
    return {
        "boot": boot, "version": "0.1.0", "simulated": True, "state": state, "session": None,
        "progress": None, "arm": dict(ARM), "camera": {"connected": True, "age_s": 3.0},
        "calibration": {"valid": True, "age_s": 9.0, "rms_px": 0.007, "sigma_mm": 0.11},
        "fault": None, **more,
    }  # fmt: skip


def seen() -> Live:
    """Return a view that a daemon has answered at 10 s."""
    live = Live("tcp://127.0.0.1:5760", STATES)
    live.answered(status(), 10.0)
    return live
