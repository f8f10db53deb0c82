"""What the page shows as present is what the daemon holds: no pose outlives its knowledge."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from legato.geometry.arm import ArmModel
from legato.records.store import Store
from legato.web.board import Board
from legato.web.present import Contacts
from legato.web.shelf import Shelf
from tests.unit.web.test_board import BANDS, RUNNING, STATUS, TOUCH, Wall, event

POSE = [[1.0, 0.0, 0.0, 5.0]]
VIEW = {"session": "s1", "boot": "b1", "solved": {"world_from_object": POSE}}
CALIBRATED = {**STATUS, "calibration": {"session": "s1", "age_s": 1.0, "stations": BANDS}}
WALL = "2026-11-22T08:00:00+00:00"


@pytest.fixture
def wall() -> Wall:
    """Give somewhere to publish to."""
    return Wall()


@pytest.fixture
def board(wall: Wall) -> Board:
    """Give a board whose daemon has found a leg and touched it."""
    made = Board(ArmModel(), wall.publish)
    made.status(CALIBRATED, WALL)
    made.looked(VIEW, {**VIEW, "by": "s1"}, Contacts("s1", "s1", BANDS, [TOUCH]))
    assert wall["leg"] == {"session": "s1", "world_from_object": POSE, "stations": BANDS}
    assert (wall["contacts"]["earlier"], wall["picture"]["earlier"]) == (False, False)
    return made


LOSSES: dict[str, Callable[[Board], None]] = {
    "the daemon has started anew": lambda b: b.status({**STATUS, "boot": "b2"}, WALL),
    "the leg was not found": lambda b: b.status({**STATUS, "state": "fault"}, WALL),
    "it is looked for anew": lambda b: b.take(
        "state", event(5, state="calibrate", previous="capture", cause="run"), WALL
    ),
    "another pose counts": lambda b: b.status(
        {**CALIBRATED, "calibration": {**CALIBRATED["calibration"], "session": "s2"}}, WALL
    ),
}


@pytest.mark.parametrize("loss", LOSSES)
def test_a_pose_goes_once_the_daemon_holds_it_no_more(board: Board, wall: Wall, loss: str) -> None:
    """The leg is gone, and contacts by its pose are marked as earlier."""
    LOSSES[loss](board)
    assert wall["leg"] is None
    assert wall["contacts"]["earlier"] is True
    assert wall["picture"]["earlier"] is (loss == "the daemon has started anew")


def test_while_the_leg_is_looked_for_no_answer_brings_the_old_one_back(
    board: Board, wall: Wall
) -> None:
    """A status that was asked a moment too early changes nothing."""
    board.take("state", event(5, state="calibrate", previous="capture", cause="run"), WALL)
    board.status({**CALIBRATED, "state": "calibrate"}, WALL)
    assert wall["leg"] is None


def test_contacts_are_held_to_the_pose_that_they_were_made_by(board: Board, wall: Wall) -> None:
    """A massage by an earlier session's pose is present as long as that pose is."""
    board.take("session", event(3, id="s2", job="massage", outcome=None), WALL)
    assert wall["contacts"] == {"session": "s2", "rows": [], "bands": BANDS, "earlier": False}
    board.take("contact", {**event(4, **TOUCH), "session": "s2"}, WALL)
    assert (wall["contacts"]["bands"], wall["contacts"]["earlier"]) == (BANDS, False)
    board.status({**STATUS, "state": "fault"}, WALL)
    assert (wall["contacts"]["bands"], wall["contacts"]["earlier"]) == (BANDS, True)


def test_a_contact_that_is_told_again_is_not_taken_for_a_present_one(wall: Wall) -> None:
    """A new subscription tells the last contact again, though another pose counts by now."""
    board = Board(ArmModel(), wall.publish)
    board.status(CALIBRATED, WALL)
    board.take("contact", {**event(4, **TOUCH), "session": "s0"}, WALL)
    assert wall["contacts"]["earlier"] is True
    board.looked(None, None, Contacts("s0", "s0", None, [TOUCH]))
    assert wall["contacts"]["earlier"] is True
    board.status({**RUNNING, "calibration": CALIBRATED["calibration"]}, WALL)
    board.take("contact", event(6, **TOUCH), WALL)
    assert wall["contacts"]["earlier"] is False


def test_the_records_say_by_which_session_s_pose_the_leg_was_touched(tmp_path: Path) -> None:
    """A massage's own record has no calibration: it is that of the last session that found one."""
    store, shelf = Store(tmp_path), Shelf(tmp_path)
    found = [session(store, 1, "run"), session(store, 2, "calibrate")]
    assert shelf.look()["touched"] is None
    touched = session(store, 3, "massage", TOUCH)
    session(store, 4, "verify")
    contacts = shelf.look()["touched"]
    assert (contacts.session, contacts.by) == (touched, found[1])
    assert contacts.bands == BANDS
    assert contacts.rows == [TOUCH]


def session(store: Store, second: int, job: str, contact: dict[str, Any] | None = None) -> str:
    """Write a session that ended well; with a calibration but for a massage."""
    wall = f"2026-11-22T08:00:0{second}+00:00"
    config = {"massage": {"contact_window_mm": 2.0}}
    writer = store.begin({"job": job, "started": wall, "config": config, "simulated": True})
    if job != "massage":
        writer.document("calibration", {"stations": [{"station_mm": 7.0, "sigma_mm": 0.1}]})
    if contact is not None:
        writer.event("contact", contact, t=1.0, wall=wall)
    writer.finish("done", None, None, wall)
    return writer.id


def test_with_no_daemon_heard_nobody_knows_what_is_earlier(wall: Wall) -> None:
    """A page whose key is refused calls nothing earlier than a daemon that it knows nothing of."""
    board = Board(ArmModel(), wall.publish)
    board.looked(VIEW, {**VIEW, "by": "s1"}, Contacts("s1", "s1", BANDS, [TOUCH]))
    assert (wall["picture"]["earlier"], wall["contacts"]["earlier"]) == (None, None)
    board.status(CALIBRATED, WALL)
    assert (wall["picture"]["earlier"], wall["contacts"]["earlier"]) == (False, False)
