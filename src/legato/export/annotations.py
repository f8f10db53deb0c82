"""What is drawn over the camera's picture: marks, where they are predicted, the leg's stations."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from legato.export.messages import stamp
from legato.geometry.transforms import Array
from legato.report.scene import Scene, silhouette, surface_samples

if TYPE_CHECKING:
    from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
    from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation

FOUND, PREDICTED, GREEN = (0.13, 0.4, 0.67, 1.0), (0.85, 0.47, 0.1, 1.0), (0.16, 0.5, 0.31, 1.0)
WHITE = (1.0, 1.0, 1.0, 0.8)


def annotations(moment_ns: int, scene: Scene, solved: Mapping[str, Any]) -> "ImageAnnotations":
    """Return the marks found and predicted, the leg's outline and its stations."""
    from foxglove_schemas_protobuf.Color_pb2 import Color
    from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
    from foxglove_schemas_protobuf.Point2_pb2 import Point2
    from foxglove_schemas_protobuf.TextAnnotation_pb2 import TextAnnotation

    found = {n: (float(u), float(v)) for n, (u, v) in (solved.get("marks") or {}).items()}
    outline = silhouette(scene.pixels(surface_samples(scene.leg)))
    tops = scene.pixels(scene.leg.surface_point(np.asarray(scene.stations, dtype=float)))
    shapes = [
        _points(moment_ns, outline, GREEN, 1.5, loop=True),
        _points(moment_ns, tops, GREEN, 6.0),
        _points(moment_ns, scene.pixels(scene.leg.points()), PREDICTED, 5.0),
        _points(moment_ns, np.array(list(found.values())).reshape(-1, 2), FOUND, 3.0),
    ]
    ink, paper = (Color(r=r, g=g, b=b, a=a) for r, g, b, a in (FOUND, WHITE))
    words = [
        TextAnnotation(
            timestamp=stamp(moment_ns),
            position=Point2(x=u + 5.0, y=v - 5.0),
            text=name,
            font_size=11.0,
            text_color=ink,
            background_color=paper,
        )
        for name, (u, v) in found.items()
    ]
    return ImageAnnotations(timestamp=stamp(moment_ns), points=shapes, texts=words)


def _points(
    moment_ns: int,
    pixels: Array,
    rgba: Sequence[float],
    thickness: float,
    *,
    loop: bool = False,
) -> "PointsAnnotation":
    """Return points, or the line about them; those not in front of the camera are left out."""
    from foxglove_schemas_protobuf.Color_pb2 import Color
    from foxglove_schemas_protobuf.Point2_pb2 import Point2
    from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation

    r, g, b, a = rgba
    seen = pixels[np.isfinite(pixels).all(axis=-1)]
    return PointsAnnotation(
        timestamp=stamp(moment_ns),
        type=PointsAnnotation.LINE_LOOP if loop else PointsAnnotation.POINTS,
        points=[Point2(x=float(u), y=float(v)) for u, v in seen],
        outline_color=Color(r=r, g=g, b=b, a=a),
        thickness=thickness,
    )
