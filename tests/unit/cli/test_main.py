"""What holds for every command: help with exit codes, light imports, errors in one line."""

import json
import subprocess
import sys
from pathlib import Path
from typing import NoReturn

import click
import pytest
from click.testing import CliRunner

from legato.cli.command import Context, command, foreseen, refused
from legato.cli.entry import run as console
from legato.cli.exits import EPILOG, Exit, Failure
from legato.cli.main import main
from legato.config.errors import ConfigError
from legato.daemon.client import DaemonUnavailable, RpcError
from legato.hal.faults import Cause, DeviceError
from tests.unit.cli.samples import document, run, write_cell

DESIGNED = (
    *("demo", "serve", "status", "run", "capture", "calibrate", "verify", "home", "massage"),
    *("pause", "resume", "stop", "estop", "reset", "reference", "watch", "sessions", "report"),
    *("detect", "solve", "intrinsics", "check"),
)


def words(text: str) -> str:
    """Return a text with single spaces."""
    return " ".join(text.split())


@pytest.mark.parametrize("name", ["", *main.commands])
def test_every_help_names_the_exit_codes(name: str) -> None:
    """Each command's --help says all exit codes, and each takes --config and --json."""
    result = run(*filter(None, [name]), "--help")
    assert result.exit_code == 0
    assert EPILOG in words(result.stdout)
    if name:
        assert "--config" in result.stdout
        assert "--json" in result.stdout


def test_every_designed_command_is_there() -> None:
    """The design's commands exist; what later work adds does not hinder."""
    assert set(DESIGNED) <= set(main.commands)


def test_streams_that_are_closed_give_their_numbers_to_nobody(tmp_path: Path) -> None:
    """Begun without its three streams a command works, and no file of its own gets their place."""
    program = (
        "import os, sys; from legato.cli.entry import whole_streams as w; w(); "
        "names = [os.readlink(f'/proc/self/fd/{n}') for n in range(3)]; "
        "sys.stderr.write('said'); print('said', flush=True); "
        f"open({str(tmp_path / 'told')!r}, 'w').write(str(names))"
    )
    command = ["bash", "-c", '"$0" -c "$1" <&- >&- 2>&-', sys.executable, program]
    subprocess.run(command, check=True, timeout=60.0)
    assert (tmp_path / "told").read_text() == str(["/dev/null"] * 3)


def test_help_loads_nothing_heavy() -> None:
    """Showing help imports neither numpy nor OpenCV, sockets, plots or the solver."""
    heavy = "{'numpy', 'cv2', 'scipy', 'zmq', 'matplotlib', 'msgspec', 'structlog', 'jinja2'}"
    code = f"import sys, legato.cli.main; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_wrong_configuration_ends_with_2_in_one_line(tmp_path: Path) -> None:
    """File, key, value and expectation stand on stderr, no traceback, and as JSON on stdout."""
    file = write_cell(tmp_path, "[robot]\nsped_scale = 0.5\n")
    result = run("check", "--config", file, "--json")
    assert result.exit_code == Exit.USAGE
    for part in (str(file), "robot.sped_scale", "0.5", "speed_scale"):
        assert part in result.stderr
    assert "Traceback" not in result.stderr
    assert document(result)["error"]["exit"] == 2


@pytest.mark.parametrize("name", [n for n in DESIGNED if n not in ("detect", "solve")])
def test_every_command_refuses_a_missing_configuration(tmp_path: Path, name: str) -> None:
    """A configuration that is not there ends each command with 2, before anything opens."""
    more = ["--out", str(tmp_path / "x.toml"), "x.png"] if name == "intrinsics" else []
    result = run(name, "--config", tmp_path / "none.toml", *more)
    assert result.exit_code == Exit.USAGE, result.output
    assert "none.toml" in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (Failure("no", Exit.REFUSED, "do"), 3, "no"),
        (ConfigError("f", "k", 1, "two"), 2, "k = 1"),
        (DaemonUnavailable("gone"), 5, "gone"),
        (RpcError(-32003, "busy", {"reason": "runs", "state": "verify"}), 3, "verify"),
        (RpcError(-32004, "in_fault", {"reason": "estop"}), 4, "estop"),
        (RpcError(-32602, "invalid_params", None), 2, "invalid"),
        (RpcError(-32603, "internal_error", None), 1, "internal"),
        (DeviceError(Cause.CAMERA_LOST, "no picture", "plug in"), 4, "camera_lost"),
        (FileNotFoundError(2, "No such file", "a.png"), 1, "a.png"),
    ],
)
def test_foreseen_errors_have_their_code(error: Exception, code: int, text: str) -> None:
    """Each error that can be foreseen ends with its own code and says what it is about."""
    failure = foreseen(error)
    assert failure is not None
    assert failure.code == code
    assert text in failure.text


def test_a_refusal_says_reason_state_and_hint() -> None:
    """What the daemon tells reaches the person."""
    told = refused(-32000, "refused_in_state", {"reason": "idle", "state": "idle", "hint": "run"})
    assert (told.text, told.hint) == ("refused_in_state: idle (state idle)", "run")


def test_a_bug_shows_its_traceback_and_ends_with_1() -> None:
    """What nobody foresaw is shown whole, with a plain line at its end."""

    @command("broken")
    def broken(context: Context) -> None:
        del context
        raise ZeroDivisionError("by design")

    assert isinstance(broken, click.Command)
    result = CliRunner().invoke(broken, [])
    assert result.exit_code == 1
    assert "Traceback" in result.stderr
    assert "legato: a bug: ZeroDivisionError: by design" in result.stderr


@pytest.mark.parametrize("as_json", [False, True])
def test_ctrl_c_while_the_command_line_loads_is_one_line(
    as_json: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before any command is known: code 1, no traceback, and the document where it is wanted."""

    def interrupted() -> NoReturn:
        raise KeyboardInterrupt

    with pytest.raises(SystemExit) as ended:
        console(interrupted, ["legato", "demo", *(["--json"] if as_json else [])])
    said = capsys.readouterr()
    assert (ended.value.code, said.err) == (1, "legato: interrupted\n")
    if as_json:
        assert json.loads(said.out)["error"]["exit"] == 1
    else:
        assert said.out == ""


def test_the_console_script_loads_little_before_it_meets_ctrl_c() -> None:
    """Its module brings in neither click nor any command."""
    look = "import sys, legato.cli.entry; print('click' in sys.modules, 'rich' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, click.Abort])
def test_ctrl_c_in_a_command_is_one_line_and_one_document(error: type[BaseException]) -> None:
    """Also at a question: code 1, without a traceback, and JSON where it was asked for."""

    @command("long")
    def long(context: Context) -> None:
        del context
        raise error

    result = CliRunner().invoke(long, ["--json"])
    assert (result.exit_code, result.stderr) == (1, "legato: interrupted\n")
    assert document(result)["error"] == {"text": "interrupted", "hint": "", "exit": 1}
