"""The TeachMover as a URDF, generated from the configuration.

Metres and rad. Joint values are turns against the link before: see `chain_angles`. The shapes are
the configuration's capsules; weights and torques are not known and not made up.
"""

from math import pi
from xml.etree import ElementTree

from legato.export.chain import ROOT, TIP, chain
from legato.geometry.arm import ArmModel

COLOURS = {
    ROOT: "0.25 0.29 0.33 1",
    "upper_arm": "0.82 0.84 0.87 1",
    "forearm": "0.82 0.84 0.87 1",
    "hand": "0.25 0.29 0.33 1",
}
NOTE = (
    " Made by legato from its configuration. Angles of shoulder, elbow and wrist_pitch are turns"
    " against the link before. Efforts are not known: 0. "
)
MILLI = 1000.0


def urdf(model: ArmModel, name: str = "teachmover") -> str:
    """Return the URDF of an arm as XML text."""
    robot = ElementTree.Element("robot", name=name)
    robot.append(ElementTree.Comment(NOTE))
    joints = chain(model)
    for link in (ROOT, *(j.child for j in joints), TIP):
        _link(robot, link, model)
    for j in joints:
        limits = {"lower": _number(j.limits[0]), "upper": _number(j.limits[1])}
        joint = _joint(robot, j.name, "revolute", (j.parent, j.child), j.origin)
        ElementTree.SubElement(joint, "axis", xyz=" ".join(f"{a:g}" for a in j.axis))
        ElementTree.SubElement(joint, "limit", limits, effort="0", velocity=_number(j.speed))
    _joint(robot, "tip", "fixed", ("hand", TIP), (model.hand, 0.0, 0.0))
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


def _joint(
    robot: ElementTree.Element,
    name: str,
    kind: str,
    links: tuple[str, str],
    origin: tuple[float, float, float],
) -> ElementTree.Element:
    """Add a joint between two links, its place in mm."""
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=links[0])
    ElementTree.SubElement(joint, "child", link=links[1])
    _origin(joint, origin)
    return joint


def _link(robot: ElementTree.Element, name: str, model: ArmModel) -> None:
    """Add a link with the cylinders that stand for it."""
    link = ElementTree.SubElement(robot, "link", name=name)
    for low, high, radius, upright in cylinders(name, model):
        for role in ("visual", "collision"):
            part = ElementTree.SubElement(link, role)
            middle = (low + high) / 2.0
            place = (0.0, 0.0, middle) if upright else (middle, 0.0, 0.0)
            _origin(part, place, (0.0, 0.0 if upright else pi / 2.0, 0.0))
            size = {"radius": _number(radius / MILLI), "length": _number((high - low) / MILLI)}
            shape = ElementTree.SubElement(part, "geometry")
            ElementTree.SubElement(shape, "cylinder", size)
            if role == "visual":
                material = ElementTree.SubElement(part, "material", name=f"{name}_colour")
                ElementTree.SubElement(material, "color", rgba=COLOURS[name])


def cylinders(name: str, model: ArmModel) -> list[tuple[float, float, float, bool]]:
    """Return a link's cylinders: from, to, radius in mm, and whether along its z or its x."""
    knuckle = model.hand - model.finger_length
    shapes = {
        ROOT: [(0.0, model.shoulder_height, model.base_radius, True)],
        "upper_arm": [(0.0, model.upper_arm, model.forearm_radius, False)],
        "forearm": [(0.0, model.forearm, model.forearm_radius, False)],
        "hand": [
            (0.0, knuckle, model.hand_radius, False),
            (knuckle, model.hand, model.finger_radius, False),
        ],
    }
    return shapes.get(name, [])


def _origin(
    parent: ElementTree.Element,
    place: tuple[float, float, float],
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:
    """Add where something sits: a place in mm, written in m, and a turn in rad."""
    xyz = " ".join(_number(c / MILLI) for c in place)
    ElementTree.SubElement(parent, "origin", xyz=xyz, rpy=" ".join(_number(a) for a in turn))


def _number(value: float) -> str:
    """Return a number with every digit that it has."""
    return repr(float(value))
