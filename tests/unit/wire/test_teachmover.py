"""The TeachMover's bytes: exact, whatever the split, and never anything but a reply or an error."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.geometry.motion import StepMove
from legato.wire.teachmover import (
    Attention,
    Close,
    Command,
    Delay,
    Done,
    Dump,
    Dumped,
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
    encode,
)
from legato.wire.teachmover_lines import LONGEST_LINE, WireError
from legato.wire.teachmover_robot import CommandParser, encode_reply
from tests.unit.wire.lines import commands, outcome, plain, registers, split

MOVE = Step(StepMove((1, -2, 30, -400, 5000, 0), 183))


@pytest.mark.parametrize(
    ("command", "line"),
    [
        (MOVE, b"@STEP 183,1,-2,30,-400,5000,0\r"),
        (Step(MOVE.move, 5), b"@STEP 183,1,-2,30,-400,5000,0,5\r"),
        (Read(), b"@READ\r"),
        (Reset(), b"@RESET\r"),
        (Close(), b"@CLOSE\r"),
        (Close(200), b"@CLOSE 200\r"),
        (Set(), b"@SET\r"),
        (Set(0), b"@SET 0\r"),
        (Attention("#"), b"@ARM #\r"),
        (Delay(7), b"@DELAY 7\r"),
        (Dump(), b"@QDUMP\r"),
        (Dump(5), b"@QDUMP\r"),
        (Write((1, 2, 3, 4, 5, 6, 7, 65535)), b"@QWRITE 1,2,3,4,5,6,7,65535\r"),
        (Run(), b"@RUN\r"),
    ],
)
def test_commands_are_the_manuals_bytes(command: Command, line: bytes) -> None:
    """Upper-case ASCII, full names, no spaces after commas, CR and no LF."""
    assert encode(command) == line


@pytest.mark.parametrize(
    ("command", "name"),
    [
        (Step(StepMove((0, 0, 32768, 0, 0, 0), 100)), "J3"),
        (Step(StepMove((0, 0, 0, 0, 0, -32769), 100)), "J6"),
        (Step(StepMove((0, 0, 0, 0, 0, 0), 246)), "speed"),
        (Step(StepMove((0, 0, 0, 0, 0, 0), -1)), "speed"),
        (Step(MOVE.move, 256), "outputs"),
        (Close(300), "speed"),
        (Delay(256), "gap"),
        (Write((1, 2, 3)), "number of words"),
        (Write((0, 0, 0, 0, 0, 0, 0, 65536)), "word"),
        (Attention("A"), "attention"),
        (Attention("##"), "attention"),
        (Attention("\r"), "attention"),
        (Attention(","), "attention"),
    ],
)
def test_values_out_of_range_are_our_error_and_named(command: Command, name: str) -> None:
    """What 16 bits or the speed's range cannot hold never reaches the line."""
    with pytest.raises(ValueError, match=name):
        encode(command)


@settings(deadline=None)
@given(registers)
def test_registers_come_from_two_lines(reply: Registers) -> None:
    """READ's acknowledgement says nothing by itself; its second line is the reply."""
    parser = ReplyParser()
    parser.expect(Read())
    first, second, _ = encode_reply(reply).split(b"\r")
    parser.receive(first + b"\r")
    assert parser.next_event() is None
    parser.receive(second + b"\r")
    assert parser.next_event() == reply
    assert parser.outstanding is None


@settings(deadline=None)
@given(commands.filter(lambda c: not isinstance(c, Read | Dump)), plain)
def test_other_commands_have_one_line(command: Command, reply: Reply) -> None:
    """One digit and CR completes any other command."""
    parser = ReplyParser()
    parser.expect(command)
    parser.receive(encode_reply(reply))
    assert parser.next_event() == reply
    assert parser.next_event() is None


@settings(deadline=None)
@given(commands, st.binary(max_size=300), st.lists(st.integers(0, 400), max_size=20))
def test_random_bytes_mean_the_same_however_split(
    command: Command, data: bytes, cuts: list[int]
) -> None:
    """Whole, byte by byte and in random chunks: the same replies, then the same WireError."""
    results = []
    for chunks in ([data], [data[i : i + 1] for i in range(len(data))], split(data, cuts)):
        parser = ReplyParser()
        parser.expect(command)
        results.append(outcome(parser, chunks))
    assert results[0] == results[1] == results[2]


@settings(deadline=None)
@given(
    st.sampled_from([Read(), Dump(), Dump(0), Dump(2)]),
    st.lists(
        st.sampled_from(
            [b"0\r", b"1\r", b"2\r", b"1,2,3,4,5,6,7\r", b"3 4  5\r", b"\n", b" ", b"9", b",", b"-"]
        )
    ),
)
def test_likely_bytes_give_a_reply_or_a_wire_error(command: Command, parts: list[bytes]) -> None:
    """Well-formed pieces in any order never give more than the one reply that was asked for."""
    parser = ReplyParser()
    parser.expect(command)
    found = outcome(parser, parts)
    assert len([f for f in found if not isinstance(f, str)]) <= 1
    assert all(isinstance(f, str | Refused | StoppedByPendant | Registers | Dumped) for f in found)


@settings(deadline=None)
@given(st.lists(commands, max_size=5), st.lists(st.integers(0, 400), max_size=20))
def test_the_robot_reads_what_the_host_writes(sent: list[Command], cuts: list[int]) -> None:
    """Any commands in any split come out of the robot's parser unchanged."""
    parser = CommandParser()
    found: list[Command | WireError] = []
    for chunk in split(b"".join(map(encode, sent)), cuts):
        parser.receive(chunk)
        found.extend(parser.events())
    assert found == sent


@pytest.mark.parametrize(
    ("line", "command"),
    [
        (b"@STE 183, 1, -2, 30, -400, 5000, 0,\r", MOVE),
        (b"@STEP 183,+1,-2,30,-400,5000,0\r", MOVE),
        (b"@REA\r", Read()),
        (b"@RESET \r", Reset()),
        (b"@CLO 9\r", Close(9)),
        (b"\r@SET\r", Set()),
        (b"@DEL 3\r", Delay(3)),
        (b"@QDU\r", Dump()),
        (b"@QWR 1, 2, 3, 4, 5, 6, 7, -8,\r", Write((1, 2, 3, 4, 5, 6, 7, -8))),
        (b"@ARM  $\r", Attention("$")),
    ],
)
def test_the_robot_tolerates_what_the_manual_allows(line: bytes, command: Command) -> None:
    """Three letters, spaces after commas, a trailing comma and empty lines are no errors."""
    parser = CommandParser()
    parser.receive(line)
    assert list(parser.events()) == [command]


@pytest.mark.parametrize(
    "line",
    [b"STEP\r", b"@STEP 1,2\r", b"@STEP 250,0,0,0,0,0,0\r", b"@READ 1\r", b"@STEP a\r", b"@X\r",
     b"@ARM\r", b"@ARM AB\r", b"@ARM \xe9\r", b"@DELAY\r", b"@DELAY 256\r", b"@RUN 1\r",
     b"@QWRITE 1,2,3,4,5,6,7\r", b"@QDUMP 1\r", b"\xe9READ\r",
     b"@STEP 1,99999,0,0,0,0,0\r", b"@STEP 1,,0,0,0,0,0,0\r", b"x" * (LONGEST_LINE + 9) + b"\r"],
)  # fmt: skip
def test_the_robot_answers_nonsense_once_and_goes_on(line: bytes) -> None:
    """A line that is no command is one WireError to be refused; the next command is read."""
    for chunks in ([line + b"@READ\r"], [bytes([b]) for b in line + b"@READ\r"]):
        parser = CommandParser()
        found: list[Command | WireError] = []
        for chunk in chunks:
            parser.receive(chunk)
            found.extend(parser.events())
        assert isinstance(found[0], WireError)
        assert found[1:] == [Read()]


def test_a_late_done_before_the_registers_is_passed_over() -> None:
    """The answer to an earlier command, come late, is not taken for the registers."""
    parser = ReplyParser()
    parser.expect(Read())
    parser.receive(b"1\r1\r1,2,3,4,5,6,0\r")
    assert parser.next_event() == Registers((1, 2, 3, 4, 5, 6), 0)


def test_registers_after_a_refused_read_are_tolerated_once() -> None:
    """Firmware that refuses and still sends them does not spoil the next command's reply."""
    parser = ReplyParser()
    parser.expect(Read())
    parser.receive(b"0\r1,2,3,4,5,6,0\r")
    assert parser.next_event() == Refused()
    parser.expect(MOVE)
    parser.receive(b"1\r")
    assert parser.next_event() == Done()
    parser.expect(MOVE)
    parser.receive(b"1,2,3,4,5,6,0\r")
    with pytest.raises(WireError, match="nobody asked"):
        parser.next_event()


@pytest.mark.parametrize(
    "data",
    [b"3\r", b"\r", b"1,2,3\r", b"1\r40000,0,0,0,0,0,0\r", b"1\r0,0,0,0,0,0,70000\r", b"\xff\r",
     b"1" * (LONGEST_LINE + 1)],
)  # fmt: skip
def test_what_no_robot_sends_is_an_error_that_lasts_until_reset(data: bytes) -> None:
    """A parser that has seen nonsense says so again and again, until it is reset."""
    parser = ReplyParser()
    parser.expect(Read())
    parser.receive(data)
    for _ in range(2):
        with pytest.raises(WireError):
            parser.next_event()
        parser.receive(b"1\r1,2,3,4,5,6,0\r")
    parser.reset()
    parser.expect(Read())
    parser.receive(b"1\r1,2,3,4,5,6,0\r")
    assert isinstance(parser.next_event(), Registers)


def test_a_reply_to_no_command_is_an_error_and_two_commands_are_ours() -> None:
    """They erred: WireError. We erred: ValueError."""
    parser = ReplyParser()
    parser.receive(b"1\r")
    with pytest.raises(WireError, match="no command"):
        parser.next_event()
    parser.reset()
    parser.expect(Read())
    with pytest.raises(ValueError, match="outstanding"):
        parser.expect(Read())


@settings(deadline=None)
@given(st.sampled_from("#$!*:~"), commands)
def test_after_arm_commands_begin_with_the_new_sign(sign: str, command: Command) -> None:
    """Host and robot change together; the old sign is refused."""
    parser = CommandParser()
    parser.receive(encode(Attention(sign)) + encode(command) + encode(command, sign))
    found = list(parser.events())
    assert found[0] == Attention(sign)
    assert isinstance(found[1], WireError)
    assert found[2] == command
