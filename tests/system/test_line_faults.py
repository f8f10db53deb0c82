"""Every fault of the emulated line, through the real daemon: its cause, its evidence, no motion."""

from pathlib import Path
from typing import Any

import pytest

from legato.daemon.client import Client, RpcError
from legato.hal.faults import Cause
from tests.system.emulated import Cell, Tables, ended, running

MARGIN_S = 0.3
TABLES: Tables = {"robot": {"reply_margin_s": MARGIN_S}, "massage": {"strokes": 1}}
LOST, LATE, EARLY = Cause.ARM_LOST, Cause.CONTACT_LATE, Cause.CONTACT_EARLY

# In the order in which they strike, `after` counting motions since the start; what a person has to
# do after reset before the arm moves again.
FAULTS: list[tuple[str, Cause, set[str]]] = [
    ("silence:after=30", Cause.ARM_TIMEOUT, {"reference"}),
    ("late:after=50,by=32", Cause.ARM_TIMEOUT, {"reference"}),
    ("garbage:after=75", LOST, {"reference"}),
    ("0:after=90", Cause.ARM_REFUSED, set()),
    ("2:after=110", Cause.ARM_STOPPED_BY_PENDANT, {"reference"}),
    ("hang-up:after=135,by=0", LOST, {"reference"}),
    ("restart:after=160", Cause.FOLLOWING_ERROR, {"reference", "calibrate"}),
    ("lost-steps:after=185,by=30", LATE, {"calibrate"}),
    ("stuck-open:after=235", LATE, {"calibrate"}),
    ("stuck-closed:after=320", EARLY, {"calibrate"}),
]


def steps(cell: Cell) -> int:
    """Return how many motions the arm has been sent."""
    return int(cell.truth()["account"]["commands"]["step"])


def refused(client: Client, method: str) -> str:
    """Return why a request is refused."""
    with pytest.raises(RpcError) as error:
        client.call(method)
    return f"{error.value} {error.value.data}"


def reset(client: Client) -> None:
    """Reset, again where the arm is not back yet."""
    for _ in range(20):
        try:
            client.call("reset")
        except RpcError:
            continue
        return
    raise AssertionError("the arm does not come back")


def test_every_fault_has_its_cause_its_bytes_and_no_motion_until_a_person_acts(
    tmp_path: Path,
) -> None:
    """One after the other on one cell, each in the middle of a job.

    The fault keeps what passed on the line last, and comes within the motion and the margin.
    Nothing moves until reset; nor after it, until the arm is referenced where its position is in
    doubt, until the leg is found anew where touch has belied it.
    """
    with running(tmp_path, *(f for f, _, _ in FAULTS), tables=TABLES, seed=3) as (cell, client):
        job = "run"
        for spelled, cause, needs in FAULTS:
            end = ended(client, job)
            assert end["outcome"] == "fault", (spelled, end)
            told = client.call("status")["fault"]
            assert told["cause"] == cause, (spelled, told)
            (kept,) = cell.record(end["session"]).of_kind("fault")
            assert_evidence(cell, kept)
            count = steps(cell)
            assert "fault" in refused(client, "home")
            reset(client)
            if "reference" in needs:
                assert "reference" in refused(client, "home")
                client.call("reference", **cell.truth()["tip"])
            if "calibrate" in needs:
                assert "calibrat" in refused(client, "massage")
            assert steps(cell) == count, f"something moved after {spelled}"
            if spelled.startswith("lost-steps"):
                client.call("reference", **cell.truth()["tip"])
            job = "run" if "calibrate" in needs else "massage"
        struck = [s["fault"].split(":")[0] for s in cell.truth()["account"]["faults"]]
        assert struck == [f.split(":")[0] for f, _, _ in FAULTS]


def assert_evidence(cell: Cell, kept: dict[str, Any]) -> None:
    """See that a fault keeps the last motion's very bytes, and came in time after them."""
    chunks = kept["data"]["evidence"]["last_bytes"]
    sent, data = cell.motions()[-1]
    assert any(repr(data) in chunk for chunk in chunks), (data, chunks)
    # The motion, the line and the margin; the rest is a busy computer's.
    assert kept["t"] - sent < 0.2 + MARGIN_S + 3.0


def test_what_a_stopped_line_says_is_kept_in_order(tmp_path: Path) -> None:
    """Evidence reads as the exchange went: each chunk with its moment, way and bytes."""
    with running(tmp_path, "2:after=12", tables=TABLES, seed=3) as (cell, client):
        end = ended(client, "run")
        (kept,) = cell.record(end["session"]).of_kind("fault")
    chunks = [c.split(" ", 2) for c in kept["data"]["evidence"]["last_bytes"]]
    assert [float(t) for t, _, _ in chunks] == sorted(float(t) for t, _, _ in chunks)
    assert [way for _, way, _ in chunks] == [">", "<"] * (len(chunks) // 2)
    assert chunks[-2][2] == repr(cell.motions()[-1][1])
    assert chunks[-1][2] == repr(b"2\r")
    assert sum("@STEP" in data for _, _, data in chunks) > 5
