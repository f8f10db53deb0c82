"""The state table: what it holds, and that nothing goes round it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from legato.control.states import (
    CellMachine,
    NotAllowed,
    deadline,
    massage_state,
    moves,
    rows,
    states,
)

STATIONS = (7.0, 67.0, 127.0, 187.0)
ALL = states(STATIONS)


def test_states_follow_the_configured_stations() -> None:
    """The massage states carry the stations' names in their order."""
    assert [s for s in ALL if s.startswith("massage")] == [
        "massage_7",
        "massage_67",
        "massage_127",
        "massage_187",
    ]
    assert massage_state(67.5) == "massage_67.5"


def test_a_run_goes_through_the_designed_order() -> None:
    """The order of a whole run is one path through the table."""
    machine = CellMachine(STATIONS)
    order = ["capture", "calibrate", "verify", "move_home"]
    order += [massage_state(s) for s in STATIONS] + ["move_home", "idle"]
    assert all(machine.enter(s) for s in order)


@given(path=st.lists(st.sampled_from(ALL), max_size=30))
def test_the_machine_follows_the_table_and_nothing_else(path: list[str]) -> None:
    """Every step is taken exactly where the table has its row; a refused one changes nothing."""
    table = set(rows(STATIONS))
    machine = CellMachine(STATIONS)
    for target in path:
        before = machine.state
        if target == before:
            assert machine.enter(target) is False
        elif (before, target) in table:
            assert machine.allows(target)
            assert machine.enter(target) is True
        else:
            assert not machine.allows(target)
            with pytest.raises(NotAllowed, match=target):
                machine.enter(target)
        assert machine.state == (target if (before, target) in table else before)


def test_fault_is_reached_from_everywhere_and_left_by_reset_alone() -> None:
    """Fault is latched: its only way out is idle."""
    table = rows(STATIONS)
    assert {s for s, t in table if t == "fault"} == set(ALL) - {"fault"}
    assert [t for s, t in table if s == "fault"] == ["idle"]


def test_every_transient_state_has_a_deadline() -> None:
    """Only idle, paused and fault may last for ever."""
    assert {s for s in ALL if deadline(s) is None} == {"idle", "paused", "fault"}


def test_motion_belongs_to_the_motion_states_only() -> None:
    """The arm may move home, in a massage, and in the retract of a stop; nowhere else."""
    assert {s for s in ALL if moves(s)} == {
        "move_home",
        "stopping",
        *(massage_state(s) for s in STATIONS),
    }
