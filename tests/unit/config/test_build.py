"""From keys to what the layers take: units are turned, nothing is left behind."""

import numpy as np
import pytest

from legato.config.build import arm_model, cell_settings, leg, world_from_camera
from legato.config.load import load
from legato.geometry.arm import ArmModel
from legato.geometry.leg import Leg
from legato.geometry.transforms import look_at
from tests.unit.config.samples import SIM, Write


def test_defaults_are_the_layers_own(write: Write) -> None:
    """The schema's defaults and the layers' defaults are the same arm and leg."""
    config = load(write(SIM)).config
    built, own = arm_model(config), ArmModel()
    assert built.steps_per_rev == own.steps_per_rev
    assert built.rates == own.rates
    assert built.grip_steps_per_mm == pytest.approx(own.grip_steps_per_mm)
    for name in ("base", "shoulder", "elbow", "wrist", "roll"):
        assert getattr(built.limits, name) == pytest.approx(getattr(own.limits, name))
    assert (built.hand, built.hand_radius, built.finger_length, built.finger_radius) == (
        own.hand, own.hand_radius, own.finger_length, own.finger_radius,
    )  # fmt: skip
    assert leg(config) == Leg(marks=dict(Leg().marks))


def test_settings_carry_every_key_in_house_units(write: Write) -> None:
    """What is configured arrives: angles in rad, the box, the search, the known camera."""
    text = SIM + (
        "[robot]\nspeed_scale = 0.5\n[robot.home]\nxyz_mm = [150, 10, 160]\nroll_deg = 90\n"
        "[cell.workspace]\nz_mm = [5, 290]\n[calibration]\npopulation = 50\n"
        "[leg]\napproach_mm = 12\n[massage]\nstrokes = 1\n"
    )
    settings = cell_settings(load(write(text)))
    assert settings.speed_scale == 0.5
    assert settings.home.vector() == pytest.approx([150, 10, 160, -np.pi / 2, np.pi / 2, 0])
    assert settings.workspace.low == (40.0, -250.0, 5.0)
    assert settings.workspace.high == (330.0, 250.0, 290.0)
    assert settings.engine.population == 50
    assert settings.approach == 12
    assert settings.massage.strokes == 1
    assert settings.simulated
    assert settings.known is not None
    assert settings.nominal == settings.known.intrinsics


def test_a_free_camera_is_not_told_the_file(write: Write) -> None:
    """With free intrinsics the file is not used; picking gets the nominal camera."""
    text = (
        SIM
        + "nothing = 0\n".replace("nothing = 0\n", "")
        + ("[calibration]\nintrinsics = 'free'\n")
    )
    settings = cell_settings(load(write(text)))
    assert settings.known is None
    assert (settings.nominal.alpha_u, settings.nominal.u0) == (650.0, 383.5)


def test_matrix_and_place_with_target_give_the_same_camera(write: Write) -> None:
    """The camera's pose may be written either way."""
    pose = look_at([228.6, -101.6, 50.8], [126.0, -4.0, 36.0])
    rows = [[float(v) for v in row] for row in pose]
    text = f'[camera]\nintrinsics = "lens.toml"\n[cell]\nworld_from_camera = {rows}\n'
    assert np.allclose(world_from_camera(load(write(text)).config), pose, atol=1e-12)
    assert np.allclose(world_from_camera(load(write(SIM)).config), pose, atol=1e-12)
