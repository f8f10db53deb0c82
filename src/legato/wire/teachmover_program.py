"""One record of the TeachMover's stored program as its eight 16-bit words.

[inferred] throughout, from a converter that course software uses with `@QWRITE`: the step's number;
255 - speed over the kind of step; then the registers to move to, low bytes in pairs, high bytes in
pairs. Targets are absolute, unlike those of `@STEP`.
"""

from dataclasses import dataclass

from legato.geometry.motion import SPEED_ZERO, SPEEDS, Steps
from legato.wire.teachmover import PROGRAM_WORDS
from legato.wire.teachmover_lines import WORD, within

MOVE = 1


@dataclass(frozen=True)
class MoveTo:
    """A step of a program: go to absolute registers at a speed."""

    number: int
    registers: Steps
    speed: int


def words(step: MoveTo) -> tuple[int, ...]:
    """Return a step's words. Raises ValueError, naming the field, for a value out of range."""
    number = within("number", step.number, 0, 255)
    slowness = SPEED_ZERO - within("speed", step.speed, *SPEEDS)
    counts = [within(f"K{i + 1}", r) % 0x10000 for i, r in enumerate(step.registers)]
    low, high = [c % 256 for c in counts], [c // 256 for c in counts]
    pairs = [256 * row[i + 1] + row[i] for row in (low, high) for i in (0, 2, 4)]
    return number, 256 * slowness + MOVE, *pairs


def move_to(record: tuple[int, ...]) -> MoveTo | None:
    """Return the step that a record's words hold; None for any other kind of step."""
    unsigned = [w % (WORD[1] + 1) for w in record]
    if len(unsigned) != PROGRAM_WORDS or unsigned[1] % 256 != MOVE:
        return None
    number, speed = unsigned[0] % 256, SPEED_ZERO - unsigned[1] // 256
    if not SPEEDS[0] <= speed <= SPEEDS[1]:
        return None
    low, high = ([w >> s & 0xFF for w in part for s in (0, 8)] for part in _halves(unsigned))
    counts = (256 * h + b for b, h in zip(low, high, strict=True))
    a, b, c, d, e, f = ((n + 0x8000) % 0x10000 - 0x8000 for n in counts)
    return MoveTo(number, (a, b, c, d, e, f), speed)


def _halves(unsigned: list[int]) -> tuple[list[int], list[int]]:
    """Return the words of the low bytes and those of the high bytes."""
    return unsigned[2:5], unsigned[5:8]
