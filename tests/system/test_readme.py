"""README's commands, as printed, against a real daemon in a home folder of its own."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.system.ports import default_ports

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
LEGATO = ".venv/bin/legato"


def blocks(kind: str, section: str = "") -> list[str]:
    """Return README's fenced blocks of a kind, of one section alone where its heading is given."""
    text = TEXT.partition(section + "\n")[2].partition("\n## ")[0] if section else TEXT
    return re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL)


def commands() -> list[str]:
    """Return every command that README tells a reader to type, in order."""
    lines = "\n".join(blocks("console")).splitlines()
    return [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]


@pytest.fixture
def home(tmp_path: Path) -> dict[str, str]:
    """Return an environment whose records go to a folder that ends with the test."""
    return os.environ | {"HOME": str(tmp_path), "COLUMNS": "120"}


@pytest.fixture
def ports() -> Iterator[None]:
    """Keep the default ports to this test."""
    with default_ports():
        yield


def run(command: str, home: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """Run one of README's commands in the home folder."""
    words = command.removeprefix(LEGATO).split()
    return subprocess.run(
        [sys.executable, "-m", "legato", *words],
        env=home,
        cwd=home["HOME"],
        capture_output=True,
        text=True,
        check=False,
        timeout=90,
    )


def answering(home: dict[str, str], config: str | None = None) -> None:
    """Wait until the daemon answers."""
    until = time.monotonic() + 30.0
    words = f"{LEGATO} status" + (f" --config {config}" if config else "")
    while run(words, home).returncode != 0:
        assert time.monotonic() < until, "the daemon never answered"


def test_every_make_target_that_readme_names_exists() -> None:
    """`make demo` and `make test` are targets of the Makefile."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = [c.removeprefix("make ") for c in commands() if c.startswith("make ")]
    assert named == ["demo", "test"]
    assert all(re.search(rf"^{target}:", makefile, re.MULTILINE) for target in named)


@pytest.mark.usefixtures("ports")
def test_readmes_commands_work_as_printed(home: dict[str, str]) -> None:
    """A reader who types them one after the other gets through a whole session and its report."""
    typed = [c for c in commands() if c.startswith(LEGATO)]
    assert typed[0] == f"{LEGATO} serve"
    serve = subprocess.Popen(
        [sys.executable, "-m", "legato", "serve"],
        env=home,
        cwd=home["HOME"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        answering(home)
        for command in typed[1:]:
            done = run(command, home)
            assert done.returncode == 0, f"{command}: {done.stderr}"
        (snippet,) = blocks("python")
        shown = subprocess.run(
            [sys.executable, "-c", snippet], capture_output=True, text=True, check=True, timeout=30
        )
        assert shown.stdout.strip() == "idle"
        assert run(f"{LEGATO} shutdown", home).returncode == 0
        assert serve.wait(timeout=20) == 0
    finally:
        serve.kill()
        serve.wait()
    assert list(Path(home["HOME"]).rglob("report.html"))


def test_every_file_that_readme_shows_or_names_exists() -> None:
    """Pictures and folders that README points to are there."""
    shown = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", TEXT)
    named = re.findall(r"`((?:etc|systemd|docs|src)/[^`*]*)`", TEXT)
    missing = [p for p in {*shown, *named} if not (ROOT / p).exists()]
    assert not missing


def test_readmes_words_for_a_cell_without_an_arm_hold(home: dict[str, str], tmp_path: Path) -> None:
    """Emulator, daemon, reference and run as printed, but for the places of link and sockets."""
    link, config = str(tmp_path / "arm"), tmp_path / "emulated.toml"
    text = (ROOT / "etc" / "emulated.toml").read_text(encoding="utf-8")
    lines = {name: f"ipc://{tmp_path}/{name}" for name in ("requests", "events", "stop")}
    text += "\n".join(["[server]", *(f'{name} = "{line}"' for name, line in lines.items())])
    config.write_text(text.replace("/tmp/legato-arm", link), encoding="utf-8")
    shutil.copy(ROOT / "etc" / "sim-intrinsics.toml", tmp_path)
    typed = [
        line.replace("/tmp/legato-arm", link).replace("etc/emulated.toml", str(config))
        for line in "".join(blocks("sh", "## Without an arm")).splitlines()
    ]
    emulate, serve, *acts = (t.removeprefix(LEGATO).split() for t in typed)
    with in_the_background(emulate, home) as emulator, in_the_background(serve, home) as served:
        answering(home, str(config))
        for words in acts:
            done = run(" ".join(words), home)
            assert done.returncode == 0, f"{words}: {done.stderr}"
        assert run(f"{LEGATO} shutdown --config {config}", home).returncode == 0
        assert served.wait(timeout=20) == 0
        emulator.send_signal(signal.SIGINT)
        said, _ = emulator.communicate(timeout=20)
    assert said.splitlines()[0] == link
    assert "12 touches, 0 breaches" in said


@contextmanager
def in_the_background(words: list[str], home: dict[str, str]) -> Iterator[subprocess.Popen[str]]:
    """Run a command in the home folder until the end of the block at the latest."""
    process = subprocess.Popen(
        [sys.executable, "-m", "legato", *words],
        env=home,
        cwd=home["HOME"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    with process:
        try:
            yield process
        finally:
            process.kill()
