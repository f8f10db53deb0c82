"""A session as one MCAP file that plays in Foxglove and Rerun.

Pictures, frames, scene, joints and log in Foxglove's schemas (protobuf); beside them every event
of the record, whole, as JSON under /record/KIND. Messages are written in the order of time, which
is the wall's; the cell's clock, which a simulated cell may run faster, is under /cell/clock.
"""

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np

from legato.export import annotations, drawing, messages
from legato.export.arm import recorded_arm
from legato.export.chain import ROOT, chain, chain_angles
from legato.export.clock import NANO, TimeLine, left, time_line
from legato.export.urdf import urdf
from legato.geometry.arm import ArmModel, skeleton
from legato.geometry.transforms import Array, rotation_from_vector, transform
from legato.records.errors import RecordError
from legato.records.files import read_bytes
from legato.records.record import SessionRecord
from legato.report.posed import posed
from legato.report.scene import leg_of, scene_of, stations_of

EVENT_SCHEMA = {
    "title": "legato.Event",
    "description": "One line of a session's events.jsonl.",
    "type": "object",
    "properties": {
        "seq": {"type": "integer"},
        "wall": {"type": "string", "format": "date-time"},
        "t": {"type": "number", "description": "the cell's clock, s"},
        "kind": {"type": "string"},
        "data": {"type": "object"},
        "previous": {"type": "string", "description": "SHA-256 of the line before"},
    },
    "required": ["seq", "wall", "t", "kind", "data"],
}
CLOCK_SCHEMA = {
    "title": "legato.Clock",
    "description": "The cell's clock at the time of the message.",
    "type": "object",
    "properties": {
        "cell_s": {"type": "number", "description": "the cell's clock, s"},
        "pace": {"type": "number", "description": "the cell's s in one of the wall's"},
    },
    "required": ["cell_s", "pace"],
}
CLOCK = "/cell/clock"
DOCUMENTS = ("session.json", "calibration.json", "truth.json")

Timed = tuple[int, str, Any]  # when in ns, topic, a protobuf message or a JSON object


@dataclass
class Channels:
    """Registers a topic with its schema when it is first written to."""

    writer: Any
    known: dict[str, int] = field(default_factory=dict)
    schemas: dict[str, int] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)

    def write(self, moment_ns: int, topic: str, message: Any) -> None:
        """Write one message at a moment."""
        plain = isinstance(message, dict)
        if topic not in self.known:
            schema = self._json(topic) if plain else self._protobuf(type(message))
            encoding = "json" if plain else "protobuf"
            self.known[topic] = self.writer.register_channel(topic, encoding, schema)
        data = json.dumps(message).encode() if plain else message.SerializeToString()
        self.counts[topic] += 1
        self.writer.add_message(self.known[topic], moment_ns, data, moment_ns, self.counts[topic])

    def _json(self, topic: str) -> int:
        schema = CLOCK_SCHEMA if topic == CLOCK else EVENT_SCHEMA
        name = str(schema["title"])
        if name not in self.schemas:
            data = json.dumps(schema).encode()
            self.schemas[name] = self.writer.register_schema(name, "jsonschema", data)
        return self.schemas[name]

    def _protobuf(self, kind: Any) -> int:
        from mcap_protobuf.schema import register_schema

        name = str(kind.DESCRIPTOR.full_name)
        if name not in self.schemas:
            self.schemas[name] = register_schema(self.writer, kind)
        return self.schemas[name]


def write_mcap(record: SessionRecord, stream: IO[bytes]) -> Counter[str]:
    """Write a session to a stream as MCAP; returns how many messages each topic has."""
    from mcap.writer import Writer

    record = posed(record)
    line, model = time_line(record), recorded_arm(record)
    writer = Writer(stream)
    writer.start(profile="", library="legato")
    channels = Channels(writer)
    for moment_ns, topic, message in sorted(timed(record, line, model), key=lambda row: row[0]):
        channels.write(moment_ns, topic, message)
    texts = {k: v if isinstance(v, str) else json.dumps(v) for k, v in record.meta.items()}
    writer.add_metadata("session", texts)
    for name, media, content in attachments(record, model):
        writer.add_attachment(line.zero_ns, line.zero_ns, name, media, content)
    writer.finish()  # type: ignore[no-untyped-call] # theirs to type
    return channels.counts


def timed(record: SessionRecord, line: TimeLine, model: ArmModel) -> Iterator[Timed]:
    """Yield all that a session's file holds, in no order."""
    yield from events(record, line)
    yield from pictures(record, line)
    yield from surroundings(record, line, model)
    yield from motion(record, line, model)


def events(record: SessionRecord, line: TimeLine) -> Iterator[Timed]:
    """Yield each event twice: whole, and as a line of the log."""
    for event in record.events:
        moment_ns = line.at(event["t"])
        yield moment_ns, f"/record/{event['kind']}", event
        yield moment_ns, "/log", messages.log(moment_ns, event)


def pictures(record: SessionRecord, line: TimeLine) -> Iterator[Timed]:
    """Yield each picture when its state was left, with the camera and the marks of the solved."""
    scene, solved = scene_of(record), record.calibration or {}
    for file in record.frames:
        moment_ns = line.at(left(record, file.stem))
        yield moment_ns, "/camera/image", messages.image(moment_ns, file.read_bytes())
        if scene is not None:
            yield moment_ns, "/camera/calibration", messages.camera(moment_ns, scene.intrinsics)
            if solved.get("picture") == f"frames/{file.name}":
                drawn = annotations.annotations(moment_ns, scene, solved)
                yield moment_ns, "/camera/annotations", drawn


def surroundings(record: SessionRecord, line: TimeLine, model: ArmModel) -> Iterator[Timed]:
    """Yield what stands still: the arm's shapes, and leg and camera once they are found."""
    yield line.zero_ns, "/scene/arm", drawing.scene(drawing.arm(line.zero_ns, model))
    scene = scene_of(record)
    if scene is None:
        return
    found = line.at(left(record, "calibrate"))
    frames = [
        messages.link(found, ROOT, "camera", scene.world_from_camera),
        messages.link(found, ROOT, "leg", scene.world_from_object),
    ]
    yield found, "/frames", messages.together(frames)
    body = drawing.leg(found, leg_of(record), stations_of(record))
    yield found, "/scene/leg", drawing.scene([body])


def motion(record: SessionRecord, line: TimeLine, model: ArmModel) -> Iterator[Timed]:
    """Yield the arm's frames, joints and fingertip at each row, its way, and the contacts."""
    path, joints = record.trajectory, chain(model)
    angles = np.stack([path[name] for name in ("t1", "t2", "t3", "pitch", "roll")], axis=-1)
    turns = chain_angles(angles)
    for t, own, turn in zip(path["t"], angles, turns, strict=True):
        moment_ns = line.at(t)
        yield moment_ns, CLOCK, {"cell_s": float(t), "pace": line.pace}
        yield moment_ns, "/arm/frames", messages.arm_frames(moment_ns, joints, turn, model.hand)
        yield moment_ns, "/joint_states", messages.joint_states(moment_ns, joints, turn)
        yield moment_ns, "/fingertip", messages.fingertip(moment_ns, tip_frame(model, own))
    last = line.zero_ns
    drawn = []
    for number, (moment_ns, why, places) in enumerate(pieces(path, line)):
        drawn.append(drawing.way(moment_ns, number, why, places))
        yield moment_ns, "/scene/way", drawing.scene(drawn[-1:])
        last = moment_ns
    for number, event in enumerate(record.of_kind("contact")):
        moment_ns = line.at(event["t"])
        drawn.append(drawing.contact(moment_ns, number, event["data"]))
        yield moment_ns, "/scene/way", drawing.scene(drawn[-1:])
        last = max(last, moment_ns)
    if drawn:  # whole once more, for a player that jumps to the end
        yield last + NANO // 1000, "/scene/way", drawing.scene(drawn)


def tip_frame(model: ArmModel, joints: Array) -> Array:
    """Return the fingertip's frame (4x4, mm) in the robot base frame: x along the hand."""
    yaw, rise, roll = joints[0], joints[3], joints[4]
    turn = rotation_from_vector([0.0, 0.0, yaw]) @ rotation_from_vector([0.0, -rise, 0.0])
    return transform(
        turn @ rotation_from_vector([roll, 0.0, 0.0]), skeleton(model, joints)[..., 3, :]
    )


def pieces(path: dict[str, Array], line: TimeLine) -> Iterator[tuple[int, str, Array]]:
    """Yield the runs of rows with one purpose: when each ended, why, its places (N, 3) in mm."""
    whys = np.asarray(path["why"])
    places = np.stack([path[a] for a in "xyz"], axis=-1)
    for run in np.split(np.arange(len(whys)), np.flatnonzero(whys[1:] != whys[:-1]) + 1):
        if run.size and whys[run[0]]:
            began = max(int(run[0]) - 1, 0)
            yield line.at(path["t"][run[-1]]), str(whys[run[0]]), places[began : run[-1] + 1]


def attachments(record: SessionRecord, model: ArmModel) -> Iterator[tuple[str, str, bytes]]:
    """Yield the record's own documents and the arm: name, media type, content."""
    for name in DOCUMENTS:
        path = Path(record.path / name)
        try:
            yield name, "application/json", read_bytes(path)
        except (FileNotFoundError, RecordError):
            continue
    yield "teachmover.urdf", "application/xml", urdf(model).encode()
