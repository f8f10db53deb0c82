"""The score: the record against a truth that is constructed by hand."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from legato.geometry.transforms import apply
from legato.records.record import SessionRecord, read_session
from legato.records.trajectory import trajectory_row
from legato.report.score import Score, score
from legato.report.strokes import strokes_of
from tests.unit.report.sessions import LEG, STATIONS, Cell, begun, pose


def touch(began: float, place: Any, surface: str = "leg") -> dict[str, Any]:
    """Return a touch as a simulated world tells it, at a place in the leg's frame."""
    return {"surface": surface, "began_s": began, "ended_s": began + 0.1,
            "object_mm": list(place), "along_mm": place[0], "depth_mm": 1.0, "force_n": 2.0,
            }  # fmt: skip


def step(cell: Cell, t: float, why: str, station: float | None) -> None:
    """Write one row of the trajectory."""
    row = trajectory_row(
        t=t, commanded=[0] * 6, read=[0] * 6, joints=[0.0] * 5, xyz=[0.0] * 3, contact=False,
        station=station, why=why,
    )  # fmt: skip
    cell.writer.trajectory(row)


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    """Return a session with two strokes at 7 mm and one at 67 mm, from 10.0 s on."""
    cell = begun(tmp_path)
    cell.calibrate()
    way: list[tuple[str, float | None]] = [("transit", None), ("approach", None)]
    way += [("descend", 7.0), ("descend", 7.0), ("press", 7.0), ("retract", 7.0)] * 2
    way += [("approach", None), ("descend", 67.0), ("press", 67.0), ("retract", 67.0)]
    way += [("transit", None)]
    for n, (why, station) in enumerate(way):
        step(cell, 10.0 + n, why, station)
    return cell


def scored(cell: Cell, **truth: Any) -> Score:
    """Return the score of a cell's session against a truth."""
    cell.writer.document("truth", {"touches": [], "breaches": [], **truth})
    return score(read_session(cell.writer.path))


def test_strokes_are_found_by_what_motions_were_for(cell: Cell) -> None:
    """A stroke runs from the end of the motion before its descent to the end of its retract."""
    spans = strokes_of(read_session(cell.writer.path))
    assert [(s.station, s.number, s.began, s.ended) for s in spans] == [
        (7.0, 1, 11.0, 15.0), (7.0, 2, 15.0, 19.0), (67.0, 1, 20.0, 23.0),
    ]  # fmt: skip


def test_readings_between_do_not_cut_a_stroke(tmp_path: Path) -> None:
    """Rows that are no motion leave a stroke whole."""
    cell = begun(tmp_path)
    for n, why in enumerate(("approach", "descend", "", "press", "", "retract")):
        step(cell, float(n), why, 7.0 if why else None)
    (stroke,) = strokes_of(read_session(cell.writer.path))
    assert (stroke.began, stroke.ended) == (0.0, 5.0)


def test_a_stations_error_is_its_worst_first_touch(cell: Cell) -> None:
    """Of each stroke the first touch counts, of each station the worst stroke."""
    seven, sixty = LEG.surface_point(7.0), LEG.surface_point(67.0)
    found = scored(cell, touches=[
        touch(13.0, seven + np.array([0.3, 0.4, 0.0])),
        touch(14.5, seven + np.array([5.0, 0.0, 0.0])),
        touch(17.0, seven + np.array([0.0, 0.6, 0.8])),
        touch(21.0, sixty),
    ])  # fmt: skip
    errors = {s.station_mm: s.error_mm for s in found.stations}
    assert errors[7.0] == pytest.approx(1.0)
    assert errors[67.0] == pytest.approx(0.0)
    assert errors[127.0] is None
    assert found.worst_mm == pytest.approx(1.0)
    assert [t.error_mm for t in found.touches] == pytest.approx([0.5, 1.0, 0.0])
    assert found.stray == ()


def test_touches_outside_strokes_and_breaches_are_listed(cell: Cell) -> None:
    """A touch on the way, or of the table, is stray; an earlier session's is nobody's."""
    place = LEG.surface_point(67.0).tolist()
    earlier, between, table = touch(9.5, place), touch(19.5, place), touch(13.0, place, "table")
    breaches = [{"kind": "touch", "what": "hand meets leg", "world_mm": [0, 0, 0], "t_s": t}
                for t in (3.0, 21.0)]  # fmt: skip
    found = scored(cell, touches=[earlier, table, between], breaches=breaches)
    assert [t["began_s"] for t in found.stray] == [13.0, 19.5]
    assert [b["t_s"] for b in found.breaches] == [21.0]
    assert found.touches == ()


def test_the_pose_error_is_turn_and_shift(cell: Cell) -> None:
    """A truth turned by half a degree and shifted by 3-4-12 mm gives just that."""
    truth = pose((3.0, 4.0, 12.0), 0.5)
    error = scored(cell, world_from_object=truth.tolist()).pose_error
    assert error is not None
    assert error.rotation_deg == pytest.approx(0.5)
    assert error.translation_mm == pytest.approx(13.0)


def test_a_whole_session_scores_as_geometry_says(whole: SessionRecord) -> None:
    """Each station is off by how far estimate and truth differ there, plus a step of the arm."""
    found = score(whole)
    assert whole.calibration is not None
    assert whole.truth is not None
    assert len(found.touches) == 12
    assert found.stray == ()
    tops = LEG.surface_point(np.array(STATIONS))
    believed = apply(np.array(whole.calibration["world_from_object"]), tops)
    true = apply(np.array(whole.truth["world_from_object"]), tops)
    across = np.linalg.norm((believed - true)[:, :2], axis=1)
    for station, apart in zip(found.stations, across, strict=True):
        assert station.strokes == 3
        assert station.error_mm == pytest.approx(apart, abs=0.35)
        assert station.place_mm == pytest.approx(station.station_mm, abs=0.35)
        assert station.touched_z_mm is not None
        assert station.predicted_z_mm == pytest.approx(station.touched_z_mm, abs=1.0)


def test_a_real_session_has_no_errors(tmp_path: Path) -> None:
    """Without a truth nothing is claimed."""
    cell = begun(tmp_path)
    cell.calibrate()
    cell.massage(7.0, strokes=1)
    found = score(read_session(cell.writer.path))
    assert not found.known
    assert found.pose_error is None
    assert found.worst_mm is None
    assert found.stations[0].contact_mm is not None
    assert [s.station_mm for s in found.stations] == list(STATIONS)


def test_an_empty_session_scores_nothing(tmp_path: Path) -> None:
    """A session that was refused at once has stations and no figures."""
    cell = begun(tmp_path)
    cell.testify()
    found = score(read_session(cell.writer.path))
    assert found.known
    assert all(s.error_mm is None and s.strokes == 0 for s in found.stations)
    assert found.as_json()["worst_mm"] is None
