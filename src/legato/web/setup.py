"""What the page's server is told once, from the configuration: lines, keys, folder, geometry."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from legato.config.build import arm_model, cell_settings, leg, world_from_camera
from legato.config.decode import decode, read_toml
from legato.config.endpoints import has_fixed_port, reachable
from legato.config.errors import ConfigError
from legato.config.load import Loaded
from legato.control.band import ACCEPTED, EXPECTED
from legato.control.settings import CellSettings
from legato.control.table import OPERATOR
from legato.daemon.keys import Keys, SecretFile, client_keys
from legato.geometry.arm import ArmModel


@dataclass(frozen=True)
class Setup:
    """Where the daemon is and who we are to it; `cell` is what the page draws that never changes.

    `role` is the client key's; without encryption everyone on this machine is an operator.
    `time_scale` is how many of the cell's seconds pass in one of the wall's.
    """

    lines: Mapping[str, str]
    keys: Keys | None
    role: str
    state_dir: Path
    model: ArmModel
    settings: CellSettings
    time_scale: float
    cell: Mapping[str, Any]


def setup_of(loaded: Loaded) -> Setup:
    """Return the setup of a configuration. Raises ConfigError."""
    config, server = loaded.config, loaded.config.server
    lines = {name: str(getattr(server, name)) for name in ("requests", "events", "stop")}
    for name, endpoint in lines.items():
        if not has_fixed_port(endpoint):
            raise ConfigError(loaded.path, f"server.{name}", endpoint, "a fixed port")
    keys, role = client_keys(server, loaded.path), OPERATOR
    if keys is not None:
        secret = Path(str(server.client_secret))
        role = decode(read_toml(secret, "a key's secret file"), SecretFile, secret).role
    return Setup(
        lines={name: reachable(endpoint) for name, endpoint in lines.items()},
        keys=keys,
        role=role,
        state_dir=Path(config.records.state_dir),
        model=arm_model(config),
        settings=cell_settings(loaded),
        time_scale=time_scale(loaded),
        cell=cell_told(loaded),
    )


def time_scale(loaded: Loaded) -> float:
    """Return how fast the cell's time goes: faster than the wall's only where all is simulated."""
    config = loaded.config
    simulated = config.robot.driver == "sim" and config.camera.driver == "sim"
    return config.sim.time_scale if simulated else 1.0


def cell_told(loaded: Loaded) -> dict[str, Any]:
    """Return the cell's measures in mm for the page's drawings."""
    config = loaded.config
    robot, table = config.robot, config.leg
    camera = config.camera
    return {
        "stations_mm": table.stations_mm,
        "time_scale": time_scale(loaded),
        "bands": {"expected": EXPECTED, "accepted": ACCEPTED},
        "contact_window_mm": config.massage.contact_window_mm,
        "descent_mm": config.massage.descent_mm,
        "strokes": config.massage.strokes,
        "table_z_mm": config.cell.table_z_mm,
        "workspace": msgspec.to_builtins(config.cell.workspace),
        "start": msgspec.to_builtins(robot.start),
        "leg": {
            "big_radius_mm": table.big_radius_mm,
            "small_radius_mm": table.small_radius_mm,
            "length_mm": table.length_mm,
            "marks": {n: list(p) for n, p in leg(config).marks.items()},
        },
        "arm": {
            "shoulder_height_mm": robot.shoulder_height_mm,
            "base_radius_mm": robot.base_radius_mm,
            "forearm_radius_mm": robot.forearm_radius_mm,
            "hand_radius_mm": robot.hand_radius_mm,
            "hand_mm": robot.hand_mm,
            "finger_length_mm": robot.finger_length_mm,
            "finger_radius_mm": robot.finger_radius_mm,
        },
        "camera": {
            "world_from_camera": world_from_camera(config).tolist(),
            "height_deg": float(
                np.degrees(2.0 * np.arctan2(camera.height / 2.0, camera.nominal_alpha_px))
            ),
            "aspect": camera.width / camera.height,
        },
    }
