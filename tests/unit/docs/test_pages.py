"""What pages tell a reader to type and to write exists: commands, options, keys, targets."""

import json
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import click
import msgspec
import pytest

from legato.cli.main import main
from legato.config.schema import Config
from tests.printed import DOCS, ROOT, Block, blocks, commands, fits, pages


def printed(kind: str) -> list[tuple[str, Block]]:
    """Return every block of a kind, with its page's name for the test's."""
    return [
        (f"{page.relative_to(DOCS)}", block)
        for page in pages()
        for block in blocks(page)
        if block.kind == kind
    ]


def typed() -> list[tuple[str, list[str]]]:
    """Return every `legato` command that a page prints, as words."""
    found = []
    for page, block in printed("console"):
        for command in commands(block):
            words = shlex.split(command.typed)
            if words and words[0] == "legato":
                found.append((page, words[1:]))
    for page, block in printed("sh"):
        lines = (shlex.split(line) for line in block.text.splitlines())
        found += [(page, words[1:]) for words in lines if words and words[0] == "legato"]
    return found


def named(printed: list[tuple[str, Any]]) -> list[Any]:
    """Return tests' parameters that carry their page's name."""
    return [pytest.param(what, id=page) for page, what in printed]


@pytest.mark.parametrize("words", named(typed()))
def test_a_printed_command_has_the_options_that_it_is_given(words: list[str]) -> None:
    """It parses; nothing is run."""
    group: click.Command = main
    parent = click.Context(main)
    while isinstance(group, click.Group) and words and words[0] in group.commands:
        group, words = group.commands[words[0]], words[1:]
        if not isinstance(group, click.Group):
            break
    assert group is not main, f"there is no command {words[0]}"
    group.make_context(group.name, list(words), parent=parent)


@pytest.mark.parametrize("block", named(printed("toml")))
def test_a_printed_piece_of_configuration_is_accepted(block: Block) -> None:
    """Its tables and keys exist and its values fit."""
    msgspec.convert(tomllib.loads(block.text), Config, strict=True)


@pytest.mark.parametrize("block", named(printed("json")))
def test_printed_json_is_json(block: Block) -> None:
    """It reads."""
    json.loads(block.text)


def test_make_targets_and_files_that_pages_name_exist() -> None:
    """`make x` is a target; paths in code that begin at the project's root are there."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for page in pages():
        text = page.read_text(encoding="utf-8")
        for target in re.findall(r"`make (\w+)`", text):
            assert re.search(rf"^{target}:", makefile, re.MULTILINE), f"{page}: make {target}"
        for place in re.findall(r"`((?:etc|systemd|src|tests|control)/[\w./-]+)`", text):
            roots = (ROOT, ROOT / "src" / "legato")
            assert any((root / place).exists() for root in roots), f"{page}: {place}"


@pytest.mark.parametrize(
    ("shown", "lines", "fit"),
    [
        (("a ... c",), ["a  b  c"], True),
        (("a", "...", "z"), ["a", "b", "c", "z"], True),
        (("a", "...", "z"), ["a", "b"], False),
        (("a",), ["a", "b"], False),
        ((), ["anything"], True),
        (("...",), [], True),
    ],
)
def test_output_is_compared_with_what_a_page_shows(
    shown: tuple[str, ...], lines: list[str], fit: bool
) -> None:
    """Dots stand for anything; every other line counts."""
    assert fits(shown, lines) is fit


def test_a_blocks_caption_and_indentation_are_no_part_of_it(tmp_path: Path) -> None:
    """A block in a list reads like any other."""
    text = "1. Do:\n\n    ```{code-block} toml\n    :caption: a.toml\n\n    x = 1\n    ```\n"
    (tmp_path / "a.md").write_text(text, encoding="utf-8")
    assert blocks(tmp_path / "a.md") == [Block("toml", "a.toml", "x = 1")]
