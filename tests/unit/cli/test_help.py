"""Every command's help: examples that the command line itself accepts, and shell completion."""

import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path

import click
import click.testing
import pytest

from legato.cli.completion import WHERE
from legato.cli.examples import EXAMPLES
from legato.cli.main import main
from tests.unit.cli.samples import document, run, write_cell


def commands(group: click.Group = main, path: tuple[str, ...] = ()) -> Iterator[str]:
    """Yield the names of all commands, those of groups after their group's."""
    for name, item in group.commands.items():
        yield " ".join((*path, name))
        if isinstance(item, click.Group):
            yield from commands(item, (*path, name))


def test_every_command_has_examples_and_none_is_of_no_command() -> None:
    """A new command without an example, or an example of a command that is gone, is found."""
    assert set(EXAMPLES) == set(commands())


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_examples_stand_in_the_help_and_are_accepted(name: str) -> None:
    """Each line is shown, and the command line reads it without an error; nothing is run."""
    shown = run(*name.split(), "--help").stdout
    for line, what in EXAMPLES[name]:
        assert line in shown
        assert what in shown
        words = shlex.split(line.partition(" | ")[0].partition(" > ")[0])
        assert words[0] == "legato"
        context: click.Context = click.Context(main)
        group: click.Command = main
        rest = words[1:]
        while isinstance(group, click.Group) and rest and rest[0] in group.commands:
            group, rest = group.commands[rest[0]], rest[1:]
        if "--help" not in rest:
            group.make_context(words[1], rest, parent=context)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_gets_its_script(shell: str) -> None:
    """It names the program and its variable; with --json it is one document."""
    text = run("completion", shell).stdout
    assert "_LEGATO_COMPLETE" in text
    told = document(run("completion", shell, "--json"))
    assert told == {"shell": shell, "script": text.rstrip("\n") + "\n", "put_it_in": WHERE[shell]}


def test_bash_completes_commands_options_and_formats(tmp_path: Path) -> None:
    """The script, read by bash, completes what the words before it allow."""
    script = tmp_path / "legato.bash"
    script.write_text(run("completion", "bash").stdout)
    if subprocess.run(["bash", "-n", str(script)], check=False).returncode:
        pytest.fail("bash does not read the script")
    for words, expected in (
        (["legato", "exp"], "export"),
        (["legato", "export", "--form"], "--format"),
        (["legato", "export", "--format", "mc"], "mcap"),
    ):
        environment = {"COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1),
                       "_LEGATO_COMPLETE": "bash_complete"}  # fmt: skip
        found = click.testing.CliRunner().invoke(main, prog_name="legato", env=environment)
        assert expected in {line.partition(",")[2] for line in found.output.splitlines()}


def test_sessions_are_completed_by_their_ids(tmp_path: Path) -> None:
    """The ids of the records that the words before name stand for SESSION."""
    cell = write_cell(tmp_path)
    folder = tmp_path / "state" / "sessions" / "20261122T050151Z-1005"
    folder.mkdir(parents=True)
    words = f"legato report --config {cell} 2026"
    environment = {"COMP_WORDS": words, "COMP_CWORD": "4", "_LEGATO_COMPLETE": "bash_complete"}
    found = click.testing.CliRunner().invoke(main, prog_name="legato", env=environment)
    assert found.output.splitlines() == ["plain,20261122T050151Z-1005"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("sessions ", {"show", "verify", "replay", "20261122T050151Z-1005"}),
        ("sessions 2026", {"20261122T050151Z-1005"}),
        ("sessions ver", {"verify"}),
        ("sessions verify 2026", {"20261122T050151Z-1005"}),
        ("sessions replay ", {"20261122T050151Z-1005"}),
        ("campaigns ", {"c-1"}),
    ],
)
def test_records_are_completed_wherever_one_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str, expected: set[str]
) -> None:
    """`sessions` completes its commands and the ids that stand for `show`; campaigns their own."""
    state = tmp_path / ".local" / "state" / "legato"
    (state / "sessions" / "20261122T050151Z-1005").mkdir(parents=True)
    heads = [{"id": "c-1"}]
    monkeypatch.setattr("legato.daemon.campaign_files.CampaignFiles.heads", lambda *_: heads)
    monkeypatch.setenv("HOME", str(tmp_path))
    line = f"legato {words}"
    environment = {"COMP_WORDS": line, "COMP_CWORD": str(line.count(" ")),
                   "_LEGATO_COMPLETE": "bash_complete"}  # fmt: skip
    found = click.testing.CliRunner().invoke(main, prog_name="legato", env=environment)
    assert {row.partition(",")[2] for row in found.output.splitlines()} == expected


def test_examples_stand_in_the_help_however_the_program_was_called() -> None:
    """`python -m legato status --help` shows what `legato status --help` does."""
    called = click.testing.CliRunner().invoke(
        main, ["status", "--help"], prog_name="python -m legato"
    )
    assert "legato status --json | jq .state" in called.output
