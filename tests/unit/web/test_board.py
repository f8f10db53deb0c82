"""Events and answers to sections, without a daemon."""

from typing import Any

import numpy as np
import pytest

from legato.geometry.arm import ArmModel, backward, forward, skeleton
from legato.web.board import LINES, Board
from legato.web.pose import posed
from legato.web.present import Contacts

ARM = {"connected": True, "referenced": True, "xyz_mm": [127.0, 0.0, 150.0], "pitch_deg": -90.0,
       "roll_deg": 0.0, "contact": False}  # fmt: skip
STATUS: dict[str, Any] = {
    "boot": "b1", "state": "idle", "session": None, "progress": None, "arm": ARM, "fault": None,
    "simulated": True, "camera": {"connected": True, "age_s": None}, "calibration": None,
}  # fmt: skip
BANDS = [{"station_mm": 7.0, "sigma_mm": 0.1, "expected_mm": 0.2, "accepted_mm": 2.0}]
TOUCH = {"station_mm": 7.0, "stroke": 1, "contact_mm": 0.1}
RUNNING = {**STATUS, "state": "massage_7", "session": "s1"}
FAULT = {"cause": "estop", "text": "t", "hint": "h", "since": "1", "session": "s1"}


class Wall(dict[str, Any]):
    """The sections as they were published last."""

    def publish(self, name: str, value: Any) -> None:
        """Take one in."""
        self[name] = value


@pytest.fixture
def wall() -> Wall:
    """Give somewhere to publish to."""
    return Wall()


@pytest.fixture
def board(wall: Wall) -> Board:
    """Give a board that has heard a first status."""
    made = Board(ArmModel(), wall.publish)
    made.status(STATUS, "0")
    return made


def event(seq: int, **data: Any) -> dict[str, Any]:
    """Return an event of the first session."""
    return {"boot": "b1", "seq": seq, "t": float(seq), "session": "s1", **data}


def test_the_line_is_down_until_the_daemon_has_spoken(wall: Wall) -> None:
    """A page that opens before the daemon is found says so."""
    board = Board(ArmModel(), wall.publish)
    assert wall["line"]["up"] is False
    board.status(STATUS, "0")
    assert wall["line"] == {"up": True, "since": "0", "boot": "b1"}
    board.lost("gone", "start it", "7")
    assert (wall["line"]["up"], wall["line"]["since"], wall["line"]["stop"]) == (False, "7", None)
    board.lost("gone", "start it", "7", stop=False)
    assert wall["line"]["stop"] is False


def test_the_graph_and_its_answers_come_from_describe(board: Board, wall: Wall) -> None:
    """Each state's answer to each method stands where the page looks for it."""
    row = {"state": "idle", "method": "pause", "answer": "refused_in_state", "reason": "r"}
    board.described(
        {
            "states": ["idle"],
            "transitions": [["idle", "fault"]],
            "table": [row],
            "methods": {"pause": {"does": "Hold."}},
        }
    )
    table = wall["table"]
    assert table["answers"]["idle"]["pause"] == {"answer": "refused_in_state", "reason": "r"}
    assert (table["transitions"], table["methods"]) == ([["idle", "fault"]], {"pause": "Hold."})


def test_contacts_come_once_and_begin_anew_with_each_massage(board: Board, wall: Wall) -> None:
    """What the record had before is put first; what is told twice counts once."""
    first, second = ({"station_mm": 7.0, "stroke": n, "contact_mm": 0.1 * n} for n in (1, 2))
    board.take("session", event(1, id="s1", job="run", outcome=None), "0")
    board.take("contact", event(2, **second), "0")
    board.take("contact", event(2, **second), "0")
    board.looked(None, None, Contacts("s1", "s1", BANDS, [first, second]))
    assert [c["stroke"] for c in wall["contacts"]["rows"]] == [1, 2]
    board.looked(None, None, Contacts("older", "older", None, [first]))
    assert wall["contacts"]["session"] == "s1"
    board.take("session", event(9, id="s2", job="massage", outcome=None), "0")
    assert (wall["contacts"]["session"], wall["contacts"]["rows"]) == ("s2", [])


def test_a_job_that_touches_nothing_leaves_the_contacts(board: Board, wall: Wall) -> None:
    """A capture afterwards does not wipe the last massage off the page."""
    board.take("contact", event(2, **TOUCH), "0")
    board.take("session", event(3, id="s2", job="capture", outcome=None), "0")
    assert len(wall["contacts"]["rows"]) == 1


def test_a_fault_keeps_its_evidence_and_goes_with_its_state(board: Board, wall: Wall) -> None:
    """Status tells no evidence and takes none away; an old fault's event is no fault."""
    board.take("fault", event(1, **FAULT, evidence={"state": "idle"}), "0")
    assert not wall["fault"]
    board.take("state", event(2, state="fault", previous="idle", cause="estop"), "0")
    board.take("fault", event(3, **FAULT, evidence={"state": "idle", "picture": None}), "0")
    board.status({**STATUS, "state": "fault", "fault": FAULT}, "0")
    assert wall["fault"]["evidence"] == [("state", ["idle"])]
    board.take("state", event(4, state="idle", previous="fault", cause="reset"), "0")
    assert wall["fault"] is None


def test_progress_of_a_session_that_has_ended_is_not_shown(board: Board, wall: Wall) -> None:
    """A new subscription tells the last progress again; it is over."""
    board.take("progress", event(5, text="press 1", done=1, total=12), "0")
    assert not wall["progress"]
    board.take("session", event(6, id="s1", job="run", outcome=None), "0")
    board.take("progress", event(7, text="press 2", done=2, total=12), "0")
    assert wall["progress"]["done"] == 2


def test_what_is_done_is_told_only_in_the_state_it_is_done_in(board: Board, wall: Wall) -> None:
    """On the way home no press is told any more, whoever says it again; how far it is stays."""
    press = {"text": "press 3 at 7 mm", "station_mm": 7.0, "done": 3, "total": 12}
    board.status({**RUNNING, "progress": press}, "0")
    assert wall["progress"]["text"] == "press 3 at 7 mm"
    board.take("state", event(4, state="move_home", previous="massage_7", cause="run"), "0")
    assert (wall["progress"]["text"], wall["progress"]["done"]) == (None, 3)
    board.status({**RUNNING, "state": "move_home", "progress": press}, "0")
    assert wall["progress"]["text"] is None
    again = {"text": "no picture, camera_lost: try 2", "station_mm": None}
    board.status({**RUNNING, "state": "capture", "progress": again}, "0")
    assert wall["progress"]["text"] == again["text"]


def test_the_list_of_events_is_bounded_and_holds_each_once(board: Board, wall: Wall) -> None:
    """Telemetry is no line; a thousand states leave as many lines as are kept."""
    for seq in [*range(1, 1000), *range(990, 1000)]:
        board.take("state", event(seq, state="idle", previous="fault", cause="x"), "0")
        board.take("heartbeat", event(10_000 + seq), "0")
    assert [line["seq"] for line in wall["lines"]] == list(range(1000 - LINES, 1000))


def test_another_boot_forgets_what_the_last_has_said(board: Board, wall: Wall) -> None:
    """The fault and session of a daemon that died are not the next one's."""
    board.take("state", event(2, state="fault", previous="idle", cause="estop"), "0")
    board.take("fault", event(3, **FAULT, evidence={}), "0")
    board.status({**STATUS, "boot": "b2"}, "5")
    assert (wall["fault"], wall["session"]) == (None, None)
    assert wall["line"]["boot"] == "b2"


def test_times_of_day_are_the_walls(wall: Wall) -> None:
    """An age in a simulated cell's faster seconds becomes a time that stands still."""
    board = Board(ArmModel(), wall.publish, time_scale=20.0)
    for second, age in ((30, 100.0), (31, 121.0)):
        told = {**STATUS, "camera": {"connected": True, "age_s": age}}
        board.status(told, f"2026-11-22T08:00:{second}+00:00")
        when = wall["status"]["when"]
        assert when == {"picture": "2026-11-22T08:00:25+00:00", "calibration": None}


def test_the_arm_stands_on_the_page_as_our_kinematics_have_it() -> None:
    """Over joints within the limits: the links are those of the joints that gave the pose."""
    model, rng = ArmModel(), np.random.default_rng(0)
    tried = 0
    for _ in range(300):
        base, shoulder = rng.uniform(-1.5, 1.5), rng.uniform(-0.5, 1.4)
        elbow = shoulder - rng.uniform(0.05, 2.5)
        joints = np.array([base, shoulder, elbow, rng.uniform(-1.6, 0.0), rng.uniform(-3.0, 3.0)])
        xyz, pitch, roll = forward(model, joints)
        if np.hypot(*xyz[:2]) < 1.0 or np.cos(np.arctan2(xyz[1], xyz[0]) - base) < 0:
            continue  # over the arm's own back
        if not np.isfinite(backward(model, xyz, pitch, roll)).all():
            continue
        tried += 1
        told = posed(model, {**ARM, "xyz_mm": xyz.tolist(), "pitch_deg": float(np.degrees(pitch)),
                             "roll_deg": float(np.degrees(roll))})  # fmt: skip
        assert np.allclose(told["links_mm"], skeleton(model, joints), atol=2e-3)
    assert tried > 200


def test_an_arm_that_is_nowhere_has_no_links() -> None:
    """Where nobody knows the pose nothing is drawn."""
    told = posed(ArmModel(), {**ARM, "xyz_mm": None, "pitch_deg": None, "roll_deg": None})
    assert (told["links_mm"], told["joints_deg"]) == (None, None)
