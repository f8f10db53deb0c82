"""The arm's stored program and its dump: bytes, words and moves."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.wire.teachmover import (
    Dump,
    Dumped,
    Read,
    Refused,
    Reply,
    ReplyParser,
)
from legato.wire.teachmover_lines import WireError
from legato.wire.teachmover_program import MoveTo, move_to, words
from legato.wire.teachmover_robot import encode_reply
from tests.unit.wire.lines import eight, six, speeds, split


@settings(deadline=None)
@given(st.lists(eight, max_size=6), st.booleans(), st.lists(st.integers(0, 400), max_size=20))
def test_a_dump_ends_at_its_count_or_when_the_line_is_quiet(
    records: list[tuple[int, ...]], counted: bool, cuts: list[int]
) -> None:
    """Records come out as they were sent, in any split, however the end is known."""
    parser = ReplyParser()
    parser.expect(Dump(len(records) if counted else None))
    found: list[Reply] = []
    for chunk in split(encode_reply(Dumped(tuple(records))), cuts):
        parser.receive(chunk)
        found.extend(parser.events())
    if not counted:
        assert found == []
        ended = parser.quiet()
        assert ended is not None
        found.append(ended)
    assert found == [Dumped(tuple(records))]
    assert parser.outstanding is None
    assert parser.quiet() is None


def test_silence_before_a_dumps_digit_is_no_dump() -> None:
    """A robot that has not answered has dumped nothing; other commands do not end by silence."""
    parser = ReplyParser()
    parser.expect(Dump())
    assert parser.quiet() is None
    parser.reset()
    parser.expect(Read())
    parser.receive(b"1\r")
    assert parser.next_event() is None
    assert parser.quiet() is None


def test_a_dump_is_read_with_blanks_or_commas_and_nonsense_in_it_is_an_error() -> None:
    """The shape of its lines is not documented: either way of parting numbers will do."""
    parser = ReplyParser()
    parser.expect(Dump(2))
    parser.receive(b"1\r 1 2   -3\r4, 5,6,\r")
    assert parser.next_event() == Dumped(((1, 2, -3), (4, 5, 6)))
    for line in (b"END\r", b"\r", b"1,2,70000\r"):
        parser.reset()
        parser.expect(Dump())
        parser.receive(b"1\r" + line)
        with pytest.raises(WireError, match="no record"):
            parser.next_event()


def test_a_refused_dump_is_refused() -> None:
    """0 ends it like any other command."""
    parser = ReplyParser()
    parser.expect(Dump())
    parser.receive(b"0\r")
    assert parser.next_event() == Refused()


@settings(deadline=None)
@given(st.builds(MoveTo, st.integers(0, 255), six, speeds))
def test_a_programs_move_survives_its_words(step: MoveTo) -> None:
    """Number, absolute registers and speed come back from eight 16-bit words."""
    packed = words(step)
    assert len(packed) == 8
    assert all(0 <= w <= 65535 for w in packed)
    assert move_to(packed) == step
    signed = tuple(w - 65536 if w > 32767 else w for w in packed)
    assert move_to(signed) == step


def test_a_programs_words_are_laid_out_as_published() -> None:
    """Slowness over kind, then low bytes of motors 2 1, 4 3, 6 5, then their high bytes."""
    step = MoveTo(3, (0x0102, 0x0304, 0x0506, -1, 0, 0x7FFF), 155)
    assert words(step) == (3, 100 * 256 + 1, 0x0402, 0xFF06, 0xFF00, 0x0301, 0xFF05, 0x7F00)


@settings(deadline=None)
@given(st.lists(st.integers(-32768, 65535), max_size=10))
def test_any_record_is_a_move_or_none(record: list[int]) -> None:
    """Other kinds of step, lengths and speeds are told apart, and never raise."""
    step = move_to(tuple(record))
    assert step is None or 0 <= step.speed <= 245


@pytest.mark.parametrize(
    ("step", "name"),
    [
        (MoveTo(256, (0, 0, 0, 0, 0, 0), 1), "number"),
        (MoveTo(0, (0, 40000, 0, 0, 0, 0), 1), "K2"),
        (MoveTo(0, (0, 0, 0, 0, 0, 0), 246), "speed"),
    ],
)
def test_a_programs_values_out_of_range_are_named(step: MoveTo, name: str) -> None:
    """What the words cannot hold is our error."""
    with pytest.raises(ValueError, match=name):
        words(step)
