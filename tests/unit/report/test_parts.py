"""The parts of a report: events and evidence in words, figures with their digits."""

from pathlib import Path

import numpy as np
import pytest

from legato.records.record import SessionRecord, read_session
from legato.report.facts import parameters
from legato.report.figures.picture import runs
from legato.report.happened import MOST_EVENTS, listed
from legato.report.html import beside, number, render
from tests.unit.report.page import Page, svg_of
from tests.unit.report.sessions import STATIONS, begun


def test_a_known_camera_has_no_bounds_to_be_out_of(whole: SessionRecord, whole_page: str) -> None:
    """f, s_x and s_y are told as known, alpha_u and alpha_v in px; only the pose has bounds."""
    rows = {row["name"]: row for row in parameters(whole.calibration or {})}
    assert list(rows)[:5] == ["f", "s_x", "s_y", "alpha_u", "alpha_v"]
    assert [rows[n]["value"] for n in ("f", "s_x", "s_y")] == [None, None, None]
    assert (rows["alpha_u"]["value"], rows["alpha_v"]["value"]) == (652.0, 655.0)
    for name in ("f", "s_x", "s_y", "alpha_u", "alpha_v", "u0", "v0"):
        assert (rows[name]["low"], rows[name]["share"], rows[name]["on_bound"]) == (
            None,
            None,
            False,
        )
    assert rows["t_z"]["share"] is not None
    text = Page(whole_page).text
    assert "f mm known" in text
    assert "alpha_u px 652.000" in text
    assert "100 % of the refined candidates agree" in text


def test_evidence_is_a_list_of_names_and_figures_with_units() -> None:
    """Tables and lists become lines; no braces, brackets or quotes of a program are left."""
    evidence = {
        "arm": {"connected": True, "xyz_mm": [126.908, 0.0, 149.945], "pitch_deg": -90.0},
        "last_effects": [
            "Grab(name='capture')",
            "Solve",
            "Move(move=Steps(n=(1, 2)), why=<Why.PRESS: 'press'>, until=None)",
            "Record('contact', {'stroke': 3, 'xyz_mm': [129.3, -2",
        ],
        "last_bytes": [],
        "depth_mm": 1.25,
        "residuals": {"P1": [0.5, -0.25]},
        "missing": None,
    }
    assert listed(evidence) == [
        ("arm", ["connected: yes", "xyz: 126.908, 0, 149.945 mm", "pitch: -90 deg"]),
        (
            "last effects",
            [
                "Grab, name capture",
                "Solve",
                "Move, move (n (1, 2)), why press",
                "Record, contact, stroke: 3, xyz_mm: [129.3, -2 ...",
            ],
        ),
        ("last bytes", ["none"]),
        ("depth", ["1.25 mm"]),
        ("residuals", ["P1: 0.5, -0.25 px"]),
        ("missing", ["none"]),
    ]


def test_every_event_is_listed_in_words_with_its_time_of_day(
    whole: SessionRecord, whole_page: str
) -> None:
    """From the first to the last, by the wall's clock, without the data's own keys."""
    text = Page(whole_page).text
    table = text[text.index("time of day, UTC") : text.index("Environment")]
    assert "1 01:47:00.000 state capture" in table
    assert f" {whole.events[-1]['seq']} " in table
    assert table.count("touched at") == len(whole.of_kind("contact"))
    assert "steps_after" not in table
    assert "left out to keep this short" not in table


def test_events_beyond_the_most_are_counted_and_placed(whole: SessionRecord) -> None:
    """Where there are too many the first go, which is said with where they are."""
    first = whole.events[0]
    whole.events[:0] = [first] * MOST_EVENTS
    text = Page(render(whole)).text
    count = len(whole.events)
    assert f"The first {count - MOST_EVENTS} of {count} events are left out" in text
    assert "events.jsonl" in text


def test_seconds_of_the_cell_are_called_so_where_its_clock_is_another(tmp_path: Path) -> None:
    """Wall and cell are told apart; where they are one, no word is lost on clocks."""
    cell = begun(tmp_path, pace=20.0)
    cell.enter("capture", "idle", 40.0)
    cell.enter("idle", "capture")
    cell.writer.finish("done", None, None, cell.wall())
    text = Page(render(read_session(cell.writer.path))).text
    assert "2.0 s, 40.0 s of the cell" in text
    assert "20 seconds of the cell passed in one of the wall" in text
    assert "01:47:02.000 state idle" in text
    cell.writer.path.joinpath("session.json").write_text(
        cell.writer.path.joinpath("session.json")
        .read_text()
        .replace('"driver":"sim"', '"driver":"x"')
    )
    assert "of the cell" not in Page(render(read_session(cell.writer.path))).text


def test_standard_deviations_and_their_figures_have_digits_enough(whole: SessionRecord) -> None:
    """Three significant digits of a sigma, and as many decimals of the figure as it is worth."""
    solved = whole.calibration
    assert solved is not None
    solved["parameters"][-1] |= {"value": 0.6941234, "sigma": 0.000367}
    text = Page(render(whole)).text
    assert "kappa rad 0.69412 0.000367" in text
    assert [beside(1.23456, s) for s in (None, 0.5, 0.0123)] == ["1.235", "1.235", "1.235"]


def test_the_first_motion_is_drawn_from_a_reading_before_it() -> None:
    """A row that is no motion tells where the arm stood; without one nothing is made up."""
    places = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    from_reading = runs(np.array(["", "transit", "transit"]), places, "transit")
    assert from_reading[:3].tolist() == places.tolist()
    without = runs(np.array(["transit", "transit", "press"]), places, "transit")
    assert without[:2].tolist() == places[:2].tolist()


@pytest.mark.parametrize(
    ("value", "shown"),
    [(None, "\N{EN DASH}"), (-0.001, "0.00"), (-1.5, "\N{MINUS SIGN}1.50"), (float("nan"), "nan")],
)
def test_numbers_are_written_for_people(value: float | None, shown: str) -> None:
    """What is not known is a dash, a minus is a minus, and zero has no sign."""
    assert number(value) == shown


def test_every_station_is_in_the_views(whole_page: str) -> None:
    """The figures are drawn with text as outlines: their labels are there as comments."""
    svg = svg_of(Page(whole_page), "from above, from the side and from the end")
    for station in STATIONS:
        assert f"<!-- {station:g} mm -->" in svg
    assert "<!-- x (mm) -->" in svg
    assert "<!-- z (mm) -->" in svg
    for title in ("From above", "From the side", "From the end"):
        assert f"<!-- {title} -->" in svg


def test_every_fault_stands_with_its_evidence_the_last_one_first(tmp_path: Path) -> None:
    """A session that met two faults shows both, the one that ended it on top."""
    cell = begun(tmp_path)
    for cause in ("camera_stale", "arm_lost"):
        cell.event("fault", cause=cause, text=f"{cause} happened", hint="look",
                   evidence={"asked": cause})  # fmt: skip
    page = Page(render(read_session(cell.writer.path))).text
    assert page.index("Fault arm_lost") < page.index("Fault camera_stale")
    assert page.index("Fault camera_stale") < page.index("What was asked")
    assert page.count("Evidence") == 2
