"""The TeachMover's serial protocol without I/O: commands to bytes, bytes to replies.

One command is outstanding at a time; its reply comes when it is done. This is the host's side,
`teachmover_robot` the robot's. What the other side sends wrongly is a WireError; what we ask for
wrongly is a ValueError. Source: the arm's manual; what no source states is marked [inferred].
"""

from dataclasses import dataclass

from legato.geometry.motion import SPEEDS, StepMove, Steps
from legato.wire.teachmover_lines import CR, INT16, WORD, Parser, WireError, numbers, within

ATTENTION = "@"
PROGRAM_WORDS = 8  # numbers in one record of the stored program [inferred from published programs]


@dataclass(frozen=True)
class Step:
    """Move all motors by relative half-steps; `outputs` sets the user output bits if given."""

    move: StepMove
    outputs: int | None = None


@dataclass(frozen=True)
class Read:
    """Ask for registers and inputs."""


@dataclass(frozen=True)
class Reset:
    """Zero the registers and cut the motors' current."""


@dataclass(frozen=True)
class Close:
    """Close the gripper until the grip switch closes."""

    speed: int | None = None


@dataclass(frozen=True)
class Set:
    """Hand control to the teach pendant; the reply comes when the person gives it back."""

    speed: int | None = None


@dataclass(frozen=True)
class Attention:
    """`@ARM`: later commands begin with another character (one printable, no letter or digit).

    Argument and reply [inferred]: the character after a blank, answered by one digit.
    """

    character: str


@dataclass(frozen=True)
class Delay:
    """`@DELAY`: the gap between the characters that the robot sends.

    Argument and its unit [inferred]: one number, 0 to 255; 0 for none.
    """

    gap: int


@dataclass(frozen=True)
class Dump:
    """`@QDUMP`: ask for the stored program.

    The reply's shape is [inferred]: a digit, then a line of numbers a record. Nothing is known to
    end it, so the host either names the number of `records` or calls `ReplyParser.quiet` when no
    more have come for a while.
    """

    records: int | None = None


@dataclass(frozen=True)
class Write:
    """`@QWRITE`: store one record of the program, PROGRAM_WORDS numbers as a dump gives them."""

    words: tuple[int, ...]


@dataclass(frozen=True)
class Run:
    """`@RUN`: run the stored program; answered when it has ended [inferred]."""


Command = Step | Read | Reset | Close | Set | Attention | Delay | Dump | Write | Run


@dataclass(frozen=True)
class Done:
    """The command was carried out."""


@dataclass(frozen=True)
class Refused:
    """The robot did not understand the command."""


@dataclass(frozen=True)
class StoppedByPendant:
    """Someone pressed STOP on the teach pendant."""


@dataclass(frozen=True)
class Registers:
    """The answer to Read: signed register counts, and last pendant key x 256 + input byte."""

    registers: Steps
    inputs: int


@dataclass(frozen=True)
class Dumped:
    """The answer to Dump: the stored program's records, each some whole numbers."""

    records: tuple[tuple[int, ...], ...]


Reply = Done | Refused | StoppedByPendant | Registers | Dumped

_DIGITS: dict[bytes, Done | Refused | StoppedByPendant] = {
    b"0": Refused(),
    b"1": Done(),
    b"2": StoppedByPendant(),
}


def encode(command: Command, attention: str = ATTENTION) -> bytes:
    """Return a command's line; `attention` is what the last Attention set.

    Raises ValueError, naming the field, for a value out of range.
    """
    name, arguments = _spelled(command)
    text = _attention(attention) + name
    if arguments:
        text += " " + ",".join(arguments)
    return text.encode("ascii") + CR


def _spelled(command: Command) -> tuple[str, list[str]]:
    """Return a command's name and its arguments. Raises ValueError."""
    match command:
        case Step(move, outputs):
            values = [within("speed", move.speed, *SPEEDS)]
            values += [within(f"J{i + 1}", s) for i, s in enumerate(move.steps)]
            values += [] if outputs is None else [within("outputs", outputs, 0, 255)]
            return "STEP", [*map(str, values)]
        case Read():
            return "READ", []
        case Reset():
            return "RESET", []
        case Close(speed):
            return "CLOSE", _speed(speed)
        case Set(speed):
            return "SET", _speed(speed)
        case Attention(character):
            return "ARM", [_attention(character)]
        case Delay(gap):
            return "DELAY", [str(within("gap", gap, 0, 255))]
        case Dump():
            return "QDUMP", []
        case Write(words):
            within("the number of words", len(words), PROGRAM_WORDS, PROGRAM_WORDS)
            return "QWRITE", [str(within("word", w, INT16[0], WORD[1])) for w in words]
        case Run():
            return "RUN", []


def _speed(speed: int | None) -> list[str]:
    """Return a speed as an argument, if there is one. Raises ValueError."""
    return [] if speed is None else [str(within("speed", speed, *SPEEDS))]


def _attention(character: str) -> str:
    """Return a character that can begin a command. Raises ValueError."""
    plain = len(character) == 1 and "!" <= character <= "~"
    if not plain or character.isalnum() or character == ",":
        raise ValueError(f"attention is one printable ASCII sign, not {character!r}")
    return character


class ReplyParser(Parser[Reply]):
    """The host's side: it knows which command is outstanding, and so what may come."""

    def __init__(self) -> None:
        super().__init__()
        self._outstanding: Command | None = None
        self._acknowledged = False
        self._stray = False
        self._records: list[tuple[int, ...]] = []

    @property
    def outstanding(self) -> Command | None:
        """The command whose reply has not come yet."""
        return self._outstanding

    def expect(self, command: Command) -> None:
        """Say which command was sent. Raises ValueError while another is outstanding."""
        if self._outstanding is not None:
            raise ValueError(f"{self._outstanding} is still outstanding")
        self._outstanding = command
        self._acknowledged = False
        self._records.clear()

    def quiet(self) -> Reply | None:
        """Say that nothing has come for a while; return the dump that this ends, if any."""
        if isinstance(self._outstanding, Dump) and self._acknowledged:
            return self._ended(Dumped(tuple(self._records)))
        return None

    def reset(self) -> None:
        """Forget bytes, errors and the outstanding command."""
        super().reset()
        self._outstanding = None
        self._acknowledged = False
        self._stray = False
        self._records.clear()

    def _message(self, line: bytes) -> Reply | None:
        """Return the reply that a line completes."""
        digit = _DIGITS.get(line)
        if digit is not None:
            return self._digit(digit, line)
        if self._acknowledged and isinstance(self._outstanding, Dump):
            return self._record(self._outstanding, line)
        registers = _registers(line)
        if registers is None:
            raise WireError(f"no reply of a TeachMover: {line!r}")
        if self._acknowledged:
            return self._ended(registers)
        if self._stray:
            self._stray = False
            return None
        raise WireError(f"registers that nobody asked for: {line!r}")

    def _digit(self, reply: Done | Refused | StoppedByPendant, line: bytes) -> Reply | None:
        """Return the reply that a digit completes."""
        if self._outstanding is None:
            raise WireError(f"a reply to no command: {line!r}")
        if isinstance(self._outstanding, Read | Dump) and isinstance(reply, Done):
            # A second 1 is the late answer to an earlier command.
            self._acknowledged = True
            return self.quiet() if self._outstanding == Dump(0) else None
        # Some firmware sends the registers even after it has refused to read them.
        self._stray = isinstance(self._outstanding, Read) and isinstance(reply, Refused)
        return self._ended(reply)

    def _record(self, dump: Dump, line: bytes) -> Reply | None:
        """Take a line of a dump, and return the dump when it is whole."""
        values = numbers(line if b"," in line else b",".join(line.split()))
        if not values or not all(INT16[0] <= v <= WORD[1] for v in values):
            raise WireError(f"no record of a program: {line!r}")
        self._records.append(tuple(values))
        return self.quiet() if len(self._records) == dump.records else None

    def _ended(self, reply: Reply) -> Reply:
        """Return a reply, after which no command is outstanding."""
        self._outstanding = None
        self._acknowledged = False
        return reply


def _registers(line: bytes) -> Registers | None:
    """Return the registers of a line, or None where it is no such line."""
    values = numbers(line)
    if values is None or len(values) != 7:
        return None
    *counts, inputs = values
    if not all(INT16[0] <= c <= INT16[1] for c in counts) or not WORD[0] <= inputs <= WORD[1]:
        return None
    a, b, c, d, e, f = counts
    return Registers((a, b, c, d, e, f), inputs)
