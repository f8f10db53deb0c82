"""What pages print: fenced blocks with their captions, commands with the output under them.

`...` in printed output stands for anything, within a line or for whole lines.
"""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
BLOCK = re.compile(
    r"^(?P<indent> *)```(?:\{code-block\} )?(?P<kind>\w+)\n"
    r"(?: *:caption: (?P<caption>[^\n]*)\n\n)?(?P<text>.*?)^(?P=indent)```$",
    re.DOTALL | re.MULTILINE,
)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page: its language, caption and text without indentation."""

    kind: str
    caption: str
    text: str


@dataclass(frozen=True)
class Command:
    """A command as printed, and the lines printed under it."""

    typed: str
    output: tuple[str, ...]


def pages() -> list[Path]:
    """Return every page that people write."""
    folders = (DOCS, DOCS / "howto", DOCS / "explanation")
    return sorted(page for folder in folders for page in folder.glob("*.md"))


def blocks(page: Path) -> list[Block]:
    """Return a page's fenced blocks in order."""
    found = []
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        lines = (line.removeprefix(block["indent"]) for line in block["text"].splitlines())
        found.append(Block(block["kind"], block["caption"] or "", "\n".join(lines)))
    return found


def commands(block: Block) -> list[Command]:
    """Return a console block's commands, each with its printed output."""
    found: list[Command] = []
    for line in block.text.splitlines():
        if line.startswith("$ "):
            found.append(Command(line.removeprefix("$ "), ()))
        elif line and found:
            found[-1] = Command(found[-1].typed, (*found[-1].output, line))
    return found


def fits(printed: tuple[str, ...], lines: list[str]) -> bool:
    """Say whether output is what was printed."""
    if not printed:
        return True
    first, rest = printed[0], printed[1:]
    if first == "...":
        return any(fits(rest, lines[k:]) for k in range(len(lines) + 1))
    return (
        bool(lines)
        and fits_line(first, lines[0])
        and (fits(rest, lines[1:]) if rest else lines[1:] == [])
    )


def fits_line(printed: str, line: str) -> bool:
    """Say whether one line is what was printed, however wide its columns are."""
    parts = (re.escape(" ".join(part.split())) for part in printed.split("..."))
    return re.fullmatch(".*".join(parts), " ".join(line.split())) is not None
