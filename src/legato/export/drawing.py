"""The leg, the arm and the fingertip's way as entities of a 3-D scene (foxglove.SceneUpdate)."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from legato.export.chain import ROOT
from legato.export.messages import METRES, placed, stamp
from legato.export.urdf import COLOURS, cylinders
from legato.geometry.arm import ArmModel
from legato.geometry.leg import Leg
from legato.geometry.transforms import Array, rotation_from_vector, transform

if TYPE_CHECKING:
    from foxglove_schemas_protobuf.Color_pb2 import Color
    from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
    from foxglove_schemas_protobuf.Point3_pb2 import Point3
    from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
    from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
    from foxglove_schemas_protobuf.TextPrimitive_pb2 import TextPrimitive

SKIN, MARK = (0.87, 0.72, 0.62, 0.9), (0.1, 0.1, 0.1, 1.0)
STATION, TOUCH = (0.16, 0.5, 0.31, 1.0), (0.76, 0.15, 0.18, 1.0)
WAY = {
    "transit": (0.6, 0.65, 0.7, 1.0),
    "approach": (0.13, 0.4, 0.67, 1.0),
    "descend": (0.85, 0.47, 0.1, 1.0),
    "press": (0.76, 0.15, 0.18, 1.0),
    "retract": (0.16, 0.5, 0.31, 1.0),
}
TURNED = transform(rotation_from_vector([0.0, np.pi / 2.0, 0.0]), np.zeros(3))  # z along x
LETTERS_MM = 8.0


def scene(entities: "Iterable[SceneEntity]") -> "SceneUpdate":
    """Return entities as one message."""
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

    return SceneUpdate(entities=list(entities))


def entity(moment_ns: int, name: str, frame: str, **shapes: Any) -> "SceneEntity":
    """Return one entity that moves with its frame and stays until it is replaced."""
    from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity

    return SceneEntity(
        timestamp=stamp(moment_ns), frame_id=frame, id=name, frame_locked=True, **shapes
    )


def leg(moment_ns: int, shape: Leg, stations: Sequence[float]) -> "SceneEntity":
    """Return the leg with its marks and stations, in its own frame."""
    tops = shape.surface_point(np.asarray(stations, dtype=float)) if stations else np.zeros((0, 3))
    spots = [_ball(p, 4.0, MARK) for p in shape.points()] + [_ball(p, 5.0, STATION) for p in tops]
    names = [*zip(shape.names(), shape.points(), strict=True)]
    names += [*zip((f"{s:g} mm" for s in stations), tops, strict=True)]
    middle = transform(TURNED[:3, :3], np.array([shape.length / 2.0, 0.0, 0.0]))
    body = _cylinder(middle, shape.big_radius, shape.length, SKIN, shape.small_radius)
    words = [_word(text, place) for text, place in names]
    return entity(moment_ns, "leg", "leg", cylinders=[body], spheres=spots, texts=words)


def arm(moment_ns: int, model: ArmModel) -> "Iterable[SceneEntity]":
    """Yield the arm's links, each in its own frame."""
    for name, colour in COLOURS.items():
        rgba = tuple(float(c) for c in colour.split())
        shapes = []
        for low, high, radius, upright in cylinders(name, model):
            middle = (low + high) / 2.0
            at = np.array([0.0, 0.0, middle] if upright else [middle, 0.0, 0.0])
            turn = np.eye(3) if upright else TURNED[:3, :3]
            shapes.append(_cylinder(transform(turn, at), radius, high - low, rgba))
        yield entity(moment_ns, f"arm {name}", name, cylinders=shapes)


def way(moment_ns: int, number: int, why: str, places: Array) -> "SceneEntity":
    """Return a piece (N, 3) of the fingertip's way in mm, in the colour of its purpose."""
    from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive

    line = LinePrimitive(
        type=LinePrimitive.LINE_STRIP,
        thickness=2.0,
        scale_invariant=True,
        points=[_point(p) for p in places],
        color=_colour(WAY.get(why, MARK)),
    )
    return entity(moment_ns, f"way {number}", ROOT, lines=[line])


def contact(moment_ns: int, number: int, told: Mapping[str, Any]) -> "SceneEntity":
    """Return where the fingertip touched."""
    place = np.asarray(told["xyz_mm"], dtype=float)
    return entity(moment_ns, f"contact {number}", ROOT, spheres=[_ball(place, 4.0, TOUCH)])


def _cylinder(
    pose: Array, radius: float, length: float, rgba: Sequence[float], top: float | None = None
) -> "CylinderPrimitive":
    """Return a cylinder about its own z, or a frustum that ends in another radius."""
    from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive

    return CylinderPrimitive(
        pose=placed(pose),
        size=_vector(2 * radius, 2 * radius, length),
        bottom_scale=1.0,
        top_scale=1.0 if top is None else top / radius,
        color=_colour(rgba),
    )


def _ball(place: Array, across: float, rgba: Sequence[float]) -> "SpherePrimitive":
    from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive

    pose = placed(transform(np.eye(3), place))
    return SpherePrimitive(pose=pose, size=_vector(across, across, across), color=_colour(rgba))


def _word(text: str, place: Array) -> "TextPrimitive":
    from foxglove_schemas_protobuf.TextPrimitive_pb2 import TextPrimitive

    x, y, z = place
    above = placed(transform(np.eye(3), [x, y, z + LETTERS_MM]))
    return TextPrimitive(
        pose=above, billboard=True, font_size=LETTERS_MM * METRES, text=text, color=_colour(MARK)
    )


def _vector(x: float, y: float, z: float) -> Any:
    from foxglove_schemas_protobuf.Vector3_pb2 import Vector3

    return Vector3(x=x * METRES, y=y * METRES, z=z * METRES)


def _point(place: Array) -> "Point3":
    from foxglove_schemas_protobuf.Point3_pb2 import Point3

    x, y, z = np.asarray(place, dtype=float) * METRES
    return Point3(x=x, y=y, z=z)


def _colour(rgba: Sequence[float]) -> "Color":
    from foxglove_schemas_protobuf.Color_pb2 import Color

    r, g, b, a = rgba
    return Color(r=r, g=g, b=b, a=a)
