"""A record's picture as the page draws over it."""

from pathlib import Path

import numpy as np
import pytest

from legato.records.record import SessionRecord, read_session
from legato.records.store import Store
from legato.report.scene import scene_of
from legato.vision.picture import encode_png
from legato.web.picture import ARROW_PX, SCALES, magnification, picture_name, view_of
from legato.web.shelf import Shelf
from tests.unit.report.sessions import whole_session


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> SessionRecord:
    """Return the record of a whole session."""
    return read_session(whole_session(tmp_path_factory.mktemp("whole")))


def test_everything_is_projected_by_the_records_own_calibration(whole: SessionRecord) -> None:
    """Marks, stations and outline lie where the report's scene puts them."""
    view, scene = view_of(whole), scene_of(whole)
    assert view is not None
    assert scene is not None
    solved = view["solved"]
    for name, point in scene.leg.marks.items():
        (pixel,) = scene.pixels(np.asarray(point)[None])
        assert np.allclose(solved["marks"][name]["predicted"], pixel, atol=0.01)
    for station in solved["stations"]:
        (top,) = scene.pixels(scene.leg.surface_point(station["station_mm"])[None])
        assert np.allclose(station["at"], top, atol=0.01)
    outline = np.array(solved["outline"])
    inside = scene.pixels(scene.leg.surface_point(scene.leg.length / 2.0)[None])[0]
    assert (outline.min(axis=0) < inside).all()
    assert (outline.max(axis=0) > inside).all()
    assert len(outline) < 721  # a corner once


def test_a_picture_without_a_calibration_is_shown_bare(whole: SessionRecord) -> None:
    """Nothing is drawn that was not solved, nor over another picture than the solved one."""
    bare = SessionRecord(whole.path, whole.meta, whole.events, whole.torn)
    bare.__dict__["calibration"] = None
    view = view_of(bare)
    assert view is not None
    assert view["solved"] is None
    other = SessionRecord(whole.path, whole.meta, whole.events, whole.torn)
    other.__dict__["calibration"] = {**(whole.calibration or {}), "picture": "frames/no.png"}
    view = view_of(other)
    assert view is not None
    assert view["solved"] is None


def test_a_session_without_pictures_has_no_view(whole: SessionRecord) -> None:
    """A homing shows the picture of whoever took one before."""
    blind = SessionRecord(whole.path, whole.meta, whole.events, whole.torn)
    blind.__dict__["frames"] = []
    assert picture_name(blind) is None
    blind.__dict__["frames"] = [whole.path / "frames" / "start-calibrated.png"]  # for replays
    assert picture_name(blind) is None
    assert view_of(blind) is None


def test_a_torn_picture_is_no_picture(whole: SessionRecord, tmp_path: Path) -> None:
    """A file that is no whole PNG is not offered to the browser."""
    torn = SessionRecord(tmp_path, whole.meta, whole.events, whole.torn)
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "capture.png").write_bytes(b"\x89PNG")
    assert torn.frames
    assert view_of(torn) is None


@pytest.mark.parametrize("largest", [0.003, 0.02, 0.4, 3.0, 37.0, 900.0])
def test_residuals_are_drawn_as_long_as_an_arrow_at_most(largest: float) -> None:
    """By a round factor, never by less than one."""
    factor = magnification(largest)
    assert factor == 1.0 or largest * factor <= ARROW_PX
    assert factor >= 1.0
    larger = [scale for scale in SCALES if scale > factor]
    assert not larger or largest * larger[0] > ARROW_PX
    assert magnification(0.0) == 1.0


def test_the_shelf_finds_picture_contacts_and_leg_of_the_newest(whole: SessionRecord) -> None:
    """And hands out no file that is not a session's picture."""
    shelf = Shelf(whole.path.parents[1])
    found = shelf.look()
    picture, solved, touched = found["picture"], found["solved"], found["touched"]
    assert picture["session"] == solved["session"] == touched.session == whole.id
    assert solved["by"] == touched.by == whole.id
    assert (picture["boot"], len(touched.bands)) == (whole.meta.get("boot"), 4)
    assert len(touched.rows) == len(whole.of_kind("contact"))
    assert shelf.look() == found
    assert shelf.frame(whole.id, whole.frames[0].name).startswith(b"\x89PNG")
    for name in ("../session.json", "session.json", "..", ""):
        with pytest.raises(FileNotFoundError):
            shelf.frame(whole.id, name)


def test_an_empty_state_folder_shows_nothing(tmp_path: Path) -> None:
    """A cell that has never worked, or whose folder is not there."""
    for folder in (tmp_path, tmp_path / "missing"):
        shelf = Shelf(folder)
        assert shelf.look() == {"picture": None, "solved": None, "touched": None}


def test_a_running_sessions_picture_is_seen_as_soon_as_it_is_there(tmp_path: Path) -> None:
    """What has ended is read once; what runs is looked at again."""
    writer = Store(tmp_path).begin({"job": "run", "started": "2026-11-22T01:47:00+00:00"})
    shelf = Shelf(tmp_path)
    assert shelf.look()["picture"] is None
    writer.frame("capture", encode_png(np.zeros((48, 64), dtype=np.uint8)))
    assert shelf.look()["picture"]["size"] == [64, 48]
    writer.frame("verify", encode_png(np.zeros((48, 64), dtype=np.uint8)))
    assert shelf.look()["picture"]["name"] == "frames/verify.png"
    writer.finish("done", None, None, "2026-11-22T01:48:00+00:00")
    assert shelf.look()["picture"]["name"] == "frames/verify.png"


@pytest.mark.parametrize(
    ("told", "simulated"),
    [
        ({"simulated": True}, True),  # as older records have it
        ({"simulated": True, "simulated_devices": ["arm", "camera"]}, True),
        ({"simulated": True, "simulated_devices": ["arm"]}, False),
        ({"simulated": True, "simulated_devices": ["camera"]}, True),
        ({"simulated": False, "simulated_devices": []}, False),
    ],
)
def test_a_picture_is_as_simulated_as_its_camera(
    whole: SessionRecord, told: dict[str, object], simulated: bool
) -> None:
    """A real camera's picture is none of a simulation, whatever moves the arm."""
    record = SessionRecord(whole.path, {**whole.meta, **told}, whole.events, whole.torn)
    if "simulated_devices" not in told:
        record.meta.pop("simulated_devices", None)
    view = view_of(record)
    assert view is not None
    assert view["simulated"] is simulated
