"""A person's picks: they go with every effect that looks for the marks, and with no other leg."""

from collections.abc import Callable

from legato.control import effects as do
from tests.unit.control.cell import Bench

PICKS = {"P1": (100.0, 120.0), "P2": (200.0, 220.0)}


def test_picks_hold_for_both_pictures_of_a_run(bench: Callable[..., Bench]) -> None:
    """The first picture is solved and the second searched near what was picked."""
    cell = bench()
    cell.memory.picks = PICKS
    assert cell.run("run") == "done"
    looked = [e.picks for e in cell.log if isinstance(e, do.Solve | do.Find)]
    assert looked == [PICKS, PICKS]


def test_without_picks_nobody_is_told_where_to_look(bench: Callable[..., Bench]) -> None:
    """Marks are found in the whole picture."""
    cell = bench()
    cell.run("run")
    assert [e.picks for e in cell.log if isinstance(e, do.Solve | do.Find)] == [None, None]
