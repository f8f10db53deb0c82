"""The robot's side of the TeachMover's serial protocol, without I/O: for emulators and tests."""

from legato.geometry.motion import StepMove
from legato.wire.teachmover import (
    ATTENTION,
    PROGRAM_WORDS,
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
    Reset,
    Run,
    Set,
    Step,
    StoppedByPendant,
    Write,
    encode,
)
from legato.wire.teachmover_lines import CR, WORD, Parser, WireError, numbers, within


def encode_reply(reply: Reply) -> bytes:
    """Return the robot's bytes for a reply; Registers are two lines, a dump one more a record."""
    match reply:
        case Done():
            return b"1" + CR
        case Refused():
            return b"0" + CR
        case StoppedByPendant():
            return b"2" + CR
        case Registers(registers, inputs):
            values = [*(within(f"K{i + 1}", r) for i, r in enumerate(registers))]
            return b"1" + CR + _line([*values, within("inputs", inputs, *WORD)])
        case Dumped(records):
            return b"1" + CR + b"".join(_line([*record]) for record in records)


def _line(values: list[int]) -> bytes:
    """Return numbers as a line."""
    return ",".join(map(str, values)).encode("ascii") + CR


class CommandParser(Parser[Command | WireError]):
    """The robot's side: a line that is no command comes out as a WireError, to be refused."""

    def __init__(self) -> None:
        super().__init__()
        self._attention = ATTENTION

    def next_event(self) -> Command | WireError | None:
        """Return the next command or the error of a line; None until more bytes come."""
        try:
            return super().next_event()
        except WireError as error:
            self._error = None
            return error

    def _message(self, line: bytes) -> Command | WireError | None:
        """Return the command of a line, or why it is none; an empty line says nothing."""
        if not line:
            return None
        try:
            command = _command(line, self._attention)
        except ValueError as error:
            return WireError(f"{line!r}: {error}")
        if isinstance(command, Attention):
            self._attention = command.character
        return command


def _command(line: bytes, attention: str) -> Command:
    """Return the command of a line. Raises ValueError."""
    if not line.startswith(attention.encode("ascii")):
        raise ValueError(f"a command begins with {attention}")
    name, _, rest = line[1:].partition(b" ")
    if name[:3] == b"ARM":
        command: Command = Attention(rest.strip(b" ").decode("latin-1"))
    else:
        values = numbers(rest)
        if values is None:
            raise ValueError("an argument is no number")
        command = _numeric(name[:3], values)
    encode(command)  # refuses what is out of range
    return command


def _numeric(name: bytes, values: list[int]) -> Command:
    """Return the command of a name's first letters and its numbers. Raises ValueError."""
    match name, len(values):
        case b"STE", 7 | 8:
            speed, a, b, c, d, e, f, *outputs = values
            return Step(StepMove((a, b, c, d, e, f), speed), *outputs)
        case b"REA", 0:
            return Read()
        case b"RES", 0:
            return Reset()
        case b"CLO", 0 | 1:
            return Close(*values)
        case b"SET", 0 | 1:
            return Set(*values)
        case b"DEL", 1:
            return Delay(*values)
        case b"QDU", 0:
            return Dump()
        case b"QWR", number if number == PROGRAM_WORDS:
            return Write(tuple(values))
        case b"RUN", 0:
            return Run()
    raise ValueError("no such command, or not with so many arguments")
