"""Foxglove's messages of a cell: pictures, camera, transforms, joints, log.

House units go in, metres and rad come out. Frames: `base` is the robot base frame W, `camera`
and `leg` are C and O, the arm's links as in its URDF.
"""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from legato.export.chain import ROOT, TIP, Joint
from legato.geometry.projection import Intrinsics
from legato.geometry.transforms import Array
from legato.report.lines import line_of

if TYPE_CHECKING:
    from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
    from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
    from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
    from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
    from foxglove_schemas_protobuf.Log_pb2 import Log
    from foxglove_schemas_protobuf.Pose_pb2 import Pose
    from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
    from google.protobuf.timestamp_pb2 import Timestamp

METRES = 1e-3


def stamp(moment_ns: int) -> "Timestamp":
    """Return a moment as protobuf writes it."""
    from google.protobuf.timestamp_pb2 import Timestamp

    seconds, nanos = divmod(moment_ns, 1_000_000_000)
    return Timestamp(seconds=seconds, nanos=nanos)


def placed(matrix: Array) -> "Pose":
    """Return a transform (4x4, mm) as a pose."""
    from foxglove_schemas_protobuf.Pose_pb2 import Pose
    from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
    from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
    from scipy.spatial.transform import Rotation

    x, y, z = matrix[:3, 3] * METRES
    qx, qy, qz, qw = Rotation.from_matrix(matrix[:3, :3]).as_quat()
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def image(moment_ns: int, png: bytes) -> "CompressedImage":
    """Return a picture as it stands in the record."""
    from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

    return CompressedImage(timestamp=stamp(moment_ns), frame_id="camera", data=png, format="png")


def camera(moment_ns: int, lens: Intrinsics) -> "CameraCalibration":
    """Return the camera's intrinsics."""
    from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration

    k = lens.matrix()
    return CameraCalibration(
        timestamp=stamp(moment_ns),
        frame_id="camera",
        width=lens.width,
        height=lens.height,
        distortion_model="plumb_bob",
        D=[lens.k1, lens.k2, 0.0, 0.0, 0.0],
        K=k.ravel().tolist(),
        R=np.eye(3).ravel().tolist(),
        P=np.column_stack([k, np.zeros(3)]).ravel().tolist(),
    )


def link(moment_ns: int, parent: str, child: str, matrix: Array) -> "FrameTransform":
    """Return where a child's frame is in its parent's (4x4, mm)."""
    from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform

    pose = placed(matrix)
    return FrameTransform(
        timestamp=stamp(moment_ns),
        parent_frame_id=parent,
        child_frame_id=child,
        translation=pose.position,
        rotation=pose.orientation,
    )


def together(transforms: "Iterable[FrameTransform]") -> "FrameTransforms":
    """Return several transforms as one message."""
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

    return FrameTransforms(transforms=list(transforms))


def arm_frames(
    moment_ns: int, joints: Iterable[Joint], angles: Array, hand: float
) -> "FrameTransforms":
    """Return every link of the arm at the chain's angles (5,); `hand` is its length in mm."""
    moved = [
        link(moment_ns, joint.parent, joint.child, joint.parent_from_child(float(angle)))
        for joint, angle in zip(joints, angles, strict=True)
    ]
    tip = np.eye(4)
    tip[0, 3] = hand
    return together([*moved, link(moment_ns, "hand", TIP, tip)])


def joint_states(moment_ns: int, joints: Iterable[Joint], angles: Array) -> "JointStates":
    """Return the chain's angles (5,) by name, rad."""
    from foxglove_schemas_protobuf.JointState_pb2 import JointState
    from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

    states = [
        JointState(name=joint.name, position=float(angle))
        for joint, angle in zip(joints, angles, strict=True)
    ]
    return JointStates(timestamp=stamp(moment_ns), joints=states)


def fingertip(moment_ns: int, matrix: Array) -> "PoseInFrame":
    """Return the fingertip's pose in the robot base frame."""
    from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame

    return PoseInFrame(timestamp=stamp(moment_ns), frame_id=ROOT, pose=placed(matrix))


def log(moment_ns: int, event: Mapping[str, Any]) -> "Log":
    """Return an event of the record as a line for people."""
    from foxglove_schemas_protobuf.Log_pb2 import Log

    kind, data = str(event.get("kind")), event.get("data")
    data = data if isinstance(data, Mapping) else {}
    bad = kind == "session" and data.get("outcome") not in (None, "done", "stopped")
    level = Log.ERROR if kind == "fault" else Log.WARNING if bad else Log.INFO
    return Log(timestamp=stamp(moment_ns), level=level, name=kind, message=line_of(kind, data))
