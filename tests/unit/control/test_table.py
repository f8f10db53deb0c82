"""The total table: every pair of state and method has one documented answer."""

import pytest

from legato.control.states import states
from legato.control.table import (
    ACTING,
    ALWAYS,
    JOBS,
    METHODS,
    READERS,
    ROLES,
    admit,
    authorise,
    describe_table,
)

STATIONS = (7.0, 67.0)
ALL = states(STATIONS)


def test_the_table_is_total() -> None:
    """Each pair is answered once, and each refusal says why and what to do."""
    table = describe_table(STATIONS)
    assert {(r["state"], r["method"]) for r in table} == {(s, m) for s in ALL for m in METHODS}
    assert len(table) == len(ALL) * len(METHODS)
    for row in table:
        refused = row["answer"] != "accepted"
        assert refused == ("reason" in row)
        assert row["answer"] in {"accepted", "busy", "in_fault", "refused_in_state"}
        assert not refused or (row["reason"] and row["hint"])


@pytest.mark.parametrize("state", ALL)
def test_reading_and_estop_are_never_refused(state: str) -> None:
    """Status, estop and their like work in every state."""
    assert all(admit(m, state) is None for m in ALWAYS)
    assert "estop" in ALWAYS


@pytest.mark.parametrize(
    ("method", "where"),
    [
        *((job, {"idle"}) for job in JOBS),
        ("campaign", {"idle"}),
        ("end_campaign", set(ALL)),
        ("reference", {"idle"}),
        ("reset", {"fault"}),
        ("resume", {"paused"}),
        ("pause", {"move_home", "massage_7", "massage_67"}),
        ("stop", set(ALL) - {"idle", "fault"}),
    ],
)
def test_each_method_is_accepted_where_it_was_designed_to_be(method: str, where: set[str]) -> None:
    """The accepted states of each acting method are those of the design, no more and no fewer."""
    assert {s for s in ALL if admit(method, s) is None} == where


def test_refusals_carry_the_designed_code() -> None:
    """A job in fault, a job while busy, and a misplaced request are told apart."""
    codes = [admit("run", "fault"), admit("run", "massage_7"), admit("resume", "idle")]
    assert [c.code for c in codes if c] == ["in_fault", "busy", "refused_in_state"]


def test_an_unknown_method_is_no_row_of_the_table() -> None:
    """The table answers for its own methods only."""
    with pytest.raises(KeyError):
        admit("self_destruct", "idle")


def test_roles_grow_and_observers_only_read() -> None:
    """Who may stop may also read, who may act may do all; a refusal says whose key can ask."""
    assert set(ROLES["observer"]) < set(ROLES["stopper"]) < set(ROLES["operator"]) == set(METHODS)
    assert set(ROLES["stopper"]) - set(ROLES["observer"]) == {"stop", "estop"}
    assert not set(ROLES["observer"]) & {*ACTING, "lease", "stop", "estop"}
    for role, methods in ROLES.items():
        for method in METHODS:
            no = authorise(method, role)
            assert (no is None) == (method in methods)
            assert no is None or (no.code == "not_authorised" and "operator" in no.hint)
    assert authorise("status", "none") is not None


def test_a_lease_never_stands_before_a_stop() -> None:
    """All that changes the cell is under the lease, but for stopping, and the lease itself."""
    assert set(METHODS) - set(ACTING) - set(READERS) == {"stop", "estop", "lease"}
