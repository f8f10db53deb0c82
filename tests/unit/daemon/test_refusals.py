"""Lines on strangers: the first at once, then at most one a second, and none is left out."""

import re
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from legato.daemon.messages import TurnedAway
from legato.daemon.refusals import ELSEWHERE, MOST, Refusals


def times(told: TurnedAway) -> int:
    """Return how many refusals a line is of."""
    found = re.search(r", (\d+) times$", told.why)
    return int(found[1]) if found else 1


def test_the_first_is_told_at_once_and_the_others_together() -> None:
    """A second later the line has how many there were, and why the last of them was refused."""
    door = Refusals()
    assert door.take("127.0.0.1", "key", "key A", 0.0) == TurnedAway("127.0.0.1", "key A")
    assert door.take("127.0.0.1", "key", "key A", 0.1) is None
    assert door.take("127.0.0.1", "key", "key B", 0.2) is None
    assert door.take("127.0.0.1", "plain", "no key", 0.3) == TurnedAway("127.0.0.1", "no key")
    assert door.take_due(0.9) == []
    assert door.next_due() == 1.0
    assert door.take_due(1.0) == [TurnedAway("127.0.0.1", "key B, 2 times")]
    assert door.take("127.0.0.1", "key", "key C", 1.5) is None
    assert door.take_due(2.0) == [TurnedAway("127.0.0.1", "key C")]
    assert door.take_due(3.0) == []
    assert door.take("127.0.0.1", "key", "key C", 3.1) is not None


@given(
    st.lists(
        st.tuples(st.integers(0, 40), st.sampled_from("kp"), st.floats(0.0, 0.3)), max_size=200
    )
)
def test_no_refusal_is_lost_and_the_log_is_not_filled(
    refused: list[tuple[int, str, float]],
) -> None:
    """From however many addresses: the counts add up, and a second has so many lines at most."""
    door, now = Refusals(), 0.0
    lines: list[tuple[float, TurnedAway]] = []
    for address, kind, later in refused:
        now += later
        lines += [(now, told) for told in door.take_due(now)]
        told = door.take(f"127.0.0.{address}", kind, "why", now)
        lines += [(now, told)] if told is not None else []
    lines += [(now + 9.0, told) for told in door.take_due(now + 9.0)]
    assert sum(times(told) for _, told in lines) == len(refused)
    for at, _ in lines:
        assert sum(at <= t < at + 1.0 for t, _ in lines) <= 2 * (MOST + 1)
    elsewhere = [t for t, told in lines if told.address == ELSEWHERE]
    assert all(after - before >= 1.0 for before, after in pairwise(elsewhere))
