"""What hosts and robots may say, for hypothesis, and ways to cut it."""

from itertools import pairwise

from hypothesis import strategies as st

from legato.geometry.motion import StepMove
from legato.wire.teachmover import (
    Close,
    Command,
    Delay,
    Done,
    Dump,
    Read,
    Refused,
    Registers,
    Reply,
    ReplyParser,
    Reset,
    Run,
    Set,
    Step,
    StoppedByPendant,
    Write,
)
from legato.wire.teachmover_lines import WireError

int16 = st.integers(-32768, 32767)
speeds = st.integers(0, 245)
six = st.tuples(int16, int16, int16, int16, int16, int16)
eight = st.tuples(*[st.integers(0, 65535)] * 8)
commands: st.SearchStrategy[Command] = st.one_of(
    st.builds(Step, st.builds(StepMove, steps=six, speed=speeds), st.none() | st.integers(0, 255)),
    st.just(Read()),
    st.just(Reset()),
    st.builds(Close, st.none() | speeds),
    st.builds(Set, st.none() | speeds),
    st.builds(Delay, st.integers(0, 255)),
    st.just(Dump()),
    st.builds(Write, eight),
    st.just(Run()),
)
registers = st.builds(Registers, six, st.integers(0, 65535))
plain: st.SearchStrategy[Reply] = st.sampled_from([Done(), Refused(), StoppedByPendant()])


def outcome(parser: ReplyParser, chunks: list[bytes]) -> list[object]:
    """Return what a parser makes of chunks: its replies, then its error's text if any."""
    found: list[object] = []
    for chunk in chunks:
        parser.receive(chunk)
        try:
            found.extend(parser.events())
        except WireError as error:
            if str(error) not in found:
                found.append(str(error))
    return found


def split(data: bytes, cuts: list[int]) -> list[bytes]:
    """Return data cut at the places that lie within it."""
    places = [0, *sorted(c % (len(data) + 1) for c in cuts), len(data)]
    return [data[a:b] for a, b in pairwise(places)]
