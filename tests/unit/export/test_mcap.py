"""The MCAP file: whole, in order, every schema resolved, every event of the record in it."""

import io
import json
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from legato.export.clock import NANO, nanoseconds, time_line
from legato.export.mcap import write_mcap
from legato.geometry.arm import ArmModel, forward
from legato.records.record import SessionRecord
from legato.report.scene import scene_of
from tests.unit.export.conftest import PACE

Message = tuple[str, int, Any]  # topic, when in ns, what


def played(record: SessionRecord) -> tuple[Any, list[Message]]:
    """Return the summary and every message, decoded by its own schema, in the file's order."""
    stream = io.BytesIO()
    counts = write_mcap(record, stream)
    stream.seek(0)
    reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
    summary = reader.get_summary()
    assert summary is not None
    found: list[Message] = []
    factory, decoders = DecoderFactory(), {}
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        assert schema is not None
        if channel.message_encoding == "json":
            assert schema.encoding == "jsonschema"
            assert json.loads(schema.data)["type"] == "object"
            content = json.loads(message.data)
        else:
            if schema.id not in decoders:
                decoders[schema.id] = factory.decoder_for(channel.message_encoding, schema)
            decoder = decoders[schema.id]
            assert decoder is not None
            content = decoder(message.data)
        found.append((channel.topic, message.log_time, content))
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(found) == sum(counts.values())
    return summary, found


@pytest.fixture(scope="module")
def file(whole: SessionRecord) -> tuple[Any, list[Message]]:
    """Return a whole session's file as it is read."""
    return played(whole)


@pytest.fixture(scope="module")
def messages(file: tuple[Any, list[Message]]) -> list[Message]:
    """Return every message of a whole session's file."""
    return file[1]


def of(messages: list[Message], topic: str) -> list[Any]:
    """Return the messages of one topic."""
    return [content for name, _, content in messages if name == topic]


def test_every_event_of_the_record_is_in_the_file(
    whole: SessionRecord, messages: list[Message]
) -> None:
    """Each event stands whole under its kind, and again as a line of the log."""
    told = [m for name, _, m in messages if name.startswith("/record/")]
    assert sorted(told, key=lambda e: e["seq"]) == whole.events
    for name, _, event in messages:
        if name.startswith("/record/"):
            assert name == f"/record/{event['kind']}"
    assert len(of(messages, "/log")) == len(whole.events)


def test_schemas_are_foxgloves_and_every_channel_has_one(file: tuple[Any, list[Message]]) -> None:
    """The names are those that Foxglove knows; files carry what the record has beside."""
    summary, _ = file
    names = {s.name for s in summary.schemas.values()}
    assert names == {
        "foxglove.CameraCalibration", "foxglove.CompressedImage", "foxglove.FrameTransforms",
        "foxglove.ImageAnnotations", "foxglove.JointStates", "foxglove.Log",
        "foxglove.PoseInFrame", "foxglove.SceneUpdate", "legato.Clock", "legato.Event",
    }  # fmt: skip
    assert all(c.schema_id in summary.schemas for c in summary.channels.values())
    attached = {index.name for index in summary.attachment_indexes}
    assert attached == {"session.json", "calibration.json", "truth.json", "teachmover.urdf"}
    assert [index.name for index in summary.metadata_indexes] == ["session"]


def test_messages_stand_in_the_order_of_time_by_the_walls_clock(
    hasty: SessionRecord,
) -> None:
    """Each stands at the time of day of its event; the cell's clock is told beside every row."""
    _, messages = played(hasty)
    moments = [moment for _, moment, _ in messages]
    assert moments == sorted(moments)
    events = [(moment, e) for name, moment, e in messages if name.startswith("/record/")]
    assert all(moment == nanoseconds(e["wall"]) for moment, e in events)
    line = time_line(hasty)
    clocks = [(moment, said) for name, moment, said in messages if name == "/cell/clock"]
    assert [said["cell_s"] for _, said in clocks] == list(hasty.trajectory["t"])
    assert all(said["pace"] == PACE for _, said in clocks)
    assert [moment for moment, _ in clocks] == [line.at(t) for t in hasty.trajectory["t"]]
    began, ended = (nanoseconds(hasty.events[i]["wall"]) for i in (0, -1))
    rounded = NANO // 1000  # the trajectory's times are
    assert all(began <= moment <= ended + rounded for moment, _ in clocks)


def test_the_links_put_the_fingertip_where_the_record_has_it(
    whole: SessionRecord, messages: list[Message]
) -> None:
    """The chain of transforms ends at the recorded place, at every row, to the file's digits."""
    frames, path = of(messages, "/arm/frames"), whole.trajectory
    assert len(frames) == path["t"].size
    for row in range(0, len(frames), 25):
        place = np.eye(4)
        for link in frames[row].transforms:
            place = place @ matrix(link)
        angles = [path[name][row] for name in ("t1", "t2", "t3", "pitch", "roll")]
        expected, _, _ = forward(ArmModel(), angles)
        assert np.allclose(place[:3, 3], expected, atol=1e-9)
        tip = of(messages, "/fingertip")[row].pose.position
        assert np.allclose([1e3 * tip.x, 1e3 * tip.y, 1e3 * tip.z], expected, atol=1e-9)
    names = [joint.name for joint in of(messages, "/joint_states")[0].joints]
    assert names == ["base_yaw", "shoulder", "elbow", "wrist_pitch", "wrist_roll"]


def matrix(link: Any) -> Any:
    """Return a FrameTransform as a 4x4 in mm."""
    q = link.rotation
    x, y, z, w = q.x, q.y, q.z, q.w
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    t = link.translation
    out[:3, 3] = 1e3 * np.array([t.x, t.y, t.z])
    return out


def test_leg_and_camera_stand_where_the_session_found_them(
    whole: SessionRecord, messages: list[Message]
) -> None:
    """The frames are the calibration's; the leg's body has its radii; each contact is drawn."""
    scene = scene_of(whole)
    assert scene is not None
    (frames,) = of(messages, "/frames")
    by_name = {t.child_frame_id: matrix(t) for t in frames.transforms}
    assert np.allclose(by_name["leg"], scene.world_from_object, atol=1e-9)
    assert np.allclose(by_name["camera"], scene.world_from_camera, atol=1e-9)
    (update,) = of(messages, "/scene/leg")
    body = update.entities[0].cylinders[0]
    assert body.size.x == pytest.approx(2e-3 * scene.leg.big_radius)
    assert body.size.x * body.top_scale == pytest.approx(2e-3 * scene.leg.small_radius)
    drawn = {e.id for m in of(messages, "/scene/way") for e in m.entities}
    assert sum(name.startswith("contact") for name in drawn) == len(whole.of_kind("contact"))


def test_pictures_are_the_records_with_camera_and_marks(
    whole: SessionRecord, messages: list[Message]
) -> None:
    """The picture's bytes are untouched; the camera's matrix is the calibration's."""
    (shown,) = of(messages, "/camera/image")
    assert shown.data == whole.frames[0].read_bytes()
    solved = whole.calibration or {}
    (lens,) = of(messages, "/camera/calibration")
    assert lens.K[0] == solved["alpha_u"]
    assert list(lens.D)[:2] == [solved["k1"], solved["k2"]]
    (marks,) = of(messages, "/camera/annotations")
    assert {text.text for text in marks.texts} == set(solved["marks"])


def test_a_broken_session_gives_what_it_has(broken_off: SessionRecord) -> None:
    """Torn, without calibration or motion: picture, events and log are there, fault as error."""
    _, messages = played(broken_off)
    topics = {name for name, _, _ in messages}
    assert topics == {"/camera/image", "/log", "/record/fault", "/record/state", "/scene/arm"}
    (fault,) = [line for line in of(messages, "/log") if line.name == "fault"]
    assert fault.level == fault.ERROR
    assert "marks_not_found" in fault.message


def test_a_session_without_any_event_is_a_valid_file(broken_off: SessionRecord) -> None:
    """Nothing but the arm's shapes is left, at the time the session was asked for."""
    for file in broken_off.frames:
        file.unlink()
    bare = SessionRecord(broken_off.path, broken_off.meta, [], torn=True)
    _, messages = played(bare)
    assert [name for name, _, _ in messages] == ["/scene/arm"]
