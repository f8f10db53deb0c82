"""The arm as URDF, read by a public library and held against our own kinematics."""

import warnings
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from ikpy.chain import Chain

from legato.export.chain import chain, chain_angles
from legato.export.mcap import tip_frame
from legato.export.urdf import urdf
from legato.geometry.arm import ArmLimits, ArmModel, broken_limits, forward

OTHER = ArmModel(shoulder_height=201.2, upper_arm=170.5, forearm=181.3, hand=99.1)


def read(model: ArmModel, folder: Path) -> Chain:
    """Return the arm's chain as the public library reads it from our URDF."""
    file = folder / "arm.urdf"
    file.write_text(urdf(model))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of the fixed ends of a chain, which are meant
        return Chain.from_urdf_file(str(file), base_elements=["base"])


def vectors(model: ArmModel, count: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return house joints (count, 5) inside the ranges of every joint."""
    rng, lim = np.random.default_rng(6), model.limits
    ranges = (lim.base, lim.shoulder, lim.elbow, lim.wrist, lim.roll)
    turns = np.stack([rng.uniform(low, high, count) for low, high in ranges], axis=-1)
    t2 = turns[:, 1]
    t3 = t2 + turns[:, 2]
    return np.stack([turns[:, 0], t2, t3, t3 + turns[:, 3], turns[:, 4]], axis=-1)


@pytest.mark.parametrize("model", [ArmModel(), OTHER])
def test_a_public_library_finds_the_fingertip_where_we_do(model: ArmModel, tmp_path: Path) -> None:
    """Place to 1e-6 mm and direction to 1e-9 on 1,000 joint vectors."""
    arm, joints = read(model, tmp_path), vectors(model, 1000)
    places, _, _ = forward(model, joints)
    for own, place, turns in zip(joints, places, chain_angles(joints), strict=True):
        found = arm.forward_kinematics([0.0, *turns, 0.0])
        assert np.abs(1e3 * found[:3, 3] - place).max() < 1e-6
        assert np.abs(found[:3, :3] - tip_frame(model, own)[:3, :3]).max() < 1e-9


def test_limits_are_the_configurations(tmp_path: Path) -> None:
    """Each joint's range is the arm's own, in turns against the link before."""
    model = ArmModel(limits=ArmLimits(base=(-1.0, 0.5), elbow=(-2.0, -0.1)))
    arm = read(model, tmp_path)
    bounds = {link.name: link.bounds for link in arm.links}
    assert bounds["base_yaw"] == (-1.0, 0.5)
    assert bounds["elbow"] == (-2.0, -0.1)
    assert all(joint.speed > 0.0 for joint in chain(model))
    joints = vectors(model, 50)
    sentences = [s for j in joints for s in broken_limits(model, j) if "outside" in s]
    assert sentences == []


def test_the_roll_keeps_the_fingers_where_they_are() -> None:
    """With the hand pitched down, a base that turns by as much as the roll leaves them still."""
    model = ArmModel()
    still = tip_frame(model, np.array([0.0, 1.5, -0.7, -np.pi / 2, 0.0]))
    turned = tip_frame(model, np.array([0.6, 1.5, -0.7, -np.pi / 2, 0.6]))
    assert np.allclose(still[:3, :3], turned[:3, :3])


def test_it_is_one_tree_from_base_to_fingertip() -> None:
    """Every link but the base is the child of exactly one joint; shapes are the configuration's."""
    robot = ElementTree.fromstring(urdf(ArmModel(hand_radius=23.0)))
    links = [link.get("name") for link in robot.findall("link")]
    children = [str(child.get("link")) for child in robot.findall("joint/child")]
    assert sorted(children) == sorted(set(map(str, links)) - {"base"})
    hand = next(link for link in robot.findall("link") if link.get("name") == "hand")
    radii = [c.get("radius") for c in hand.findall("visual/geometry/cylinder")]
    assert radii == ["0.023", "0.008"]
