"""The tutorial's commands, as printed, in the shells of a newcomer with an empty home folder."""

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from docs.gen import records
from docs.gen.events import FIELDS
from tests.printed import DOCS, ROOT, Block, Command, blocks, commands, fits
from tests.system.ports import default_ports

TUTORIAL = DOCS / "tutorial.md"
PICTURES = DOCS / "howto" / "pictures.md"
RECORDS = DOCS / "howto" / "records.md"
MARK = "--- ended with"
FIRST = "first terminal"
ID = re.compile(r"\b\d{8}T\d{6}Z-[0-9a-f]{4}\b")
A_RUN_S = 60.0  # of the cell, at least


class Shell:
    """One terminal: a shell that stays open, so that `$?` and `cd` mean what they mean."""

    def __init__(self, home: Path) -> None:
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        self._process = subprocess.Popen(
            ["bash", "--noprofile", "--norc"],
            env=os.environ | {"HOME": str(home), "PATH": path, "COLUMNS": "200"},
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def type(self, command: str) -> list[str]:
        """Type a command and return the lines that it prints until it has ended."""
        self.send(f"{command}\n_ended=$?; echo '{MARK}'; (exit $_ended)")
        assert self._process.stdout is not None
        lines: list[str] = []
        for line in self._process.stdout:
            if line.strip() == MARK:
                return lines
            lines.append(line.rstrip())
        raise AssertionError(f"the shell ended at: {command}")

    def send(self, command: str) -> None:
        """Type a command and do not wait."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{command}\n")
        self._process.stdin.flush()

    def close(self) -> None:
        """End the shell; what it runs has ended or ends with its input."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        try:
            self._process.wait(20.0)
        finally:
            self._process.kill()
            self._process.wait()
            self._process.stdout.close()


@contextmanager
def shells(home: Path) -> Iterator[tuple[Shell, Shell]]:
    """Give two terminals; a daemon that a failed test leaves behind is shut down."""
    first, second = Shell(home), Shell(home)
    try:
        yield first, second
        second.type("true")
    finally:
        second.send("legato shutdown >/dev/null 2>&1")
        second.close()
        first.close()


def follow(block: Block, first: Shell, second: Shell, home: Path) -> None:
    """Do what a block of the tutorial says."""
    if block.kind == "toml":
        file = home / "cell" / "sim.toml"
        text = file.read_text(encoding="utf-8")
        if block.caption == "change in ~/cell/sim.toml":
            slow_enough(block.text, text)
            return
        assert block.caption == "append to ~/cell/sim.toml"
        file.write_text(f"{text}\n{block.text}\n", encoding="utf-8")
        return
    for command in commands(block):
        if block.caption == FIRST:
            first.send(f"{command.typed} >serve.log 2>&1".replace("serve.log", str(home / "log")))
            answering(second, home)
        else:
            typed = ID.sub(lambda _: whole_run(home), command.typed)
            expect(command, second.type(typed))


def slow_enough(told: str, text: str) -> None:
    """See that what is told is in the file's `[sim]`, and gives a person time to watch and stop.

    It is not put there: the test need not wait as long as a person likes to.
    """
    table, line = told.splitlines()
    key, _, value = line.partition(" = ")
    assert (table, key) == ("[sim]", "time_scale")
    assert re.search(rf"^\[sim\][^\[]*^{key} = ", text, re.MULTILINE)
    assert A_RUN_S / float(value) >= 25.0


def whole_run(home: Path) -> str:
    """Return the id of the run that is done, which a person reads from the list."""
    found = []
    for file in (home / ".local/state/legato/sessions").glob("*/session.json"):
        told = json.loads(file.read_text(encoding="utf-8"))
        found += [told["id"]] if (told["job"], told["outcome"]) == ("run", "done") else []
    (run,) = found
    return str(run)


def answering(shell: Shell, home: Path) -> None:
    """Wait until the daemon answers."""
    until = time.monotonic() + 30.0
    while "state" not in " ".join(shell.type("legato status 2>/dev/null")):
        assert time.monotonic() < until, (home / "log").read_text()


def expect(command: Command, lines: list[str]) -> None:
    """See that a command printed what the tutorial shows."""
    shown, got = "\n".join(command.output), "\n".join(lines)
    assert fits(command.output, lines), f"$ {command.typed}\n{got}\n--- but the page shows\n{shown}"


@pytest.mark.timeout(300)
def test_a_newcomer_who_types_the_tutorial_gets_what_it_shows(tmp_path: Path) -> None:
    """Install is another test's; from then on each command ends and prints as the page says."""
    install, *rest = [b for b in blocks(TUTORIAL) if b.kind in ("console", "toml")]
    assert [c.typed for c in commands(install)] == ["make env", ". .venv/bin/activate"]
    with default_ports(), shells(tmp_path) as (first, second):
        for block in rest:
            follow(block, first, second, tmp_path)
    reports = list(tmp_path.rglob("report.html"))
    assert [report.parent.name for report in reports] == [whole_run(tmp_path)]
    sessions = sorted((tmp_path / ".local/state/legato/sessions").iterdir())
    assert len(sessions) == 4
    for session in sessions:
        told_in_the_reference(session)
    (snippet,) = [b for b in blocks(RECORDS) if b.kind == "python"]
    shown = subprocess.run(
        [sys.executable, "-c", snippet.text],
        env=os.environ | {"HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert re.fullmatch(r"\d+ rows, \d+ of them in a press\n", shown.stdout)


def told_in_the_reference(session: Path) -> None:
    """See that the reference explains every file and field of a record."""
    for path in session.iterdir():
        place = f"{path.name}/" if path.is_dir() else path.name
        assert place in records.FILES, f"no word of {place}"
    for name, fields in (
        ("session.json", records.SESSION), ("calibration.json", records.CALIBRATION),
        ("truth.json", records.TRUTH),
    ):  # fmt: skip
        if (session / name).exists():
            found = json.loads((session / name).read_text(encoding="utf-8"))
            assert not set(found) - set(fields), f"{name}: {set(found) - set(fields)}"
    for line in (session / "events.jsonl").read_text(encoding="utf-8").splitlines():
        event = json.loads(line)
        assert set(event) == set(records.EVENT)
        unknown = set(event["data"]) - set(FIELDS[event["kind"]].fields)
        if event["kind"] == "session" and event["data"]["outcome"] is None:
            unknown -= {"head"}  # of the record alone: the reference tells it beside the seal
        assert not unknown, f"event {event['kind']}: {unknown}"


def test_the_commands_on_pictures_work_as_printed(tmp_path: Path) -> None:
    """Each ends well, in a folder of its own and without a daemon."""
    shell = Shell(tmp_path)
    try:
        shell.type("cd ~")
        for block in blocks(PICTURES):
            for command in commands(block) if block.kind == "console" else ():
                lines = shell.type(command.typed)
                expect(command, lines)
                assert shell.type("echo $?") == ["0"], f"$ {command.typed}\n" + "\n".join(lines)
    finally:
        shell.close()
