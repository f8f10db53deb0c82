"""The whole job through the TeachMover's driver, on the pseudo-terminal of `legato emulate`.

What was touched is told by the emulator's own world, of which the daemon knows nothing.
"""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from bench.ptypasses import massage, seen
from legato.cli.exits import Exit
from legato.cli.main import main
from legato.daemon.client import RpcError
from legato.geometry.leg import Leg
from legato.hal.faults import Cause
from tests.system.emulated import HOME, Cell, configuration, ended, running

STATIONS = (7.0, 67.0, 127.0, 187.0)


def test_the_whole_job_over_the_line(tmp_path: Path) -> None:
    """Every true touch lies at its station, and nothing else is touched or asked too much."""
    with running(tmp_path, seed=3, backlash_steps=6.0) as (cell, client):
        before = cell.truth()
        assert ended(client, "run")["outcome"] == "done"
        truth = cell.truth()
    assert before["account"]["commands"]["step"] == 0
    assert truth["breaches"] == []
    assert truth["lost_steps"] == [0.0] * 6
    assert {t["surface"] for t in truth["touches"]} == {"leg"}
    places = np.array([t["object_mm"] for t in truth["touches"]])
    wanted = np.repeat(Leg().surface_point(list(STATIONS)), 3, axis=0)
    errors = np.linalg.norm(places - wanted, axis=1)
    assert errors.max() <= 1.0
    assert np.sqrt((errors**2).mean()) <= 0.5
    assert truth["tip"]["xyz_mm"] == pytest.approx(HOME["xyz_mm"], abs=1.5)


def test_a_leg_turned_and_tilted_far_from_home_is_massaged_all_the_same() -> None:
    """At the edge of the yaw and tilt that are promised, over the line; `ptypasses` has 100."""
    pose = {"leg_at_mm": [196.0, -95.0, 45.0], "leg_yaw_deg": 114.5, "leg_rise_deg": 11.5}
    found = massage(5, seen(pose | {"leg_roll_deg": -5.9}))
    assert found["outcome"] == "done", found["reason"]
    assert len(found["errors"]) == 12
    assert max(found["errors"]) <= 1.0
    assert (found["bad"], found["lost"]) == (0, 0.0)


def test_a_leg_out_of_reach_is_refused_before_the_arm_moves() -> None:
    """Verify names the station and the joint, and not one motion has been sent."""
    pose = {"leg_at_mm": [105.0, -63.0, 50.0], "leg_yaw_deg": 110.0, "leg_rise_deg": 3.0}
    found = massage(5, seen(pose | {"leg_roll_deg": 0.0}))
    assert found["outcome"] == "refused"
    assert re.search(r"station \d+ mm: .*elbow -\d+\.\d+ deg is outside", found["reason"])
    assert found["moved"] == 0


def test_a_vanished_adapter_is_a_fault_until_reset_and_reference(tmp_path: Path) -> None:
    """The fault keeps the last bytes, nothing moves until a person has acted, and then it does."""
    with running(tmp_path, "hang-up:after=70,by=0", seed=3) as (cell, client):
        end = ended(client, "run")
        assert end["outcome"] == "fault"
        fault = client.call("status")["fault"]
        assert fault["cause"] == Cause.ARM_LOST
        (kept,) = cell.record(end["session"]).of_kind("fault")
        assert any("@STEP" in chunk for chunk in kept["data"]["evidence"]["last_bytes"])
        with pytest.raises(RpcError, match="fault"):
            client.call("home")
        assert cell.truth()["account"]["commands"]["step"] == 71
        client.call("reset")
        assert client.call("status")["state"] == "idle"
        with pytest.raises(RpcError) as refused:
            client.call("home")
        assert "reference" in str(refused.value.data)
        truth = cell.truth()
        assert truth["account"]["commands"]["step"] == 71
        client.call("reference", **truth["tip"])
        assert ended(client, "home")["outcome"] == "done"
        assert cell.truth()["tip"]["xyz_mm"] == pytest.approx(HOME["xyz_mm"], abs=1.5)


def test_the_link_goes_with_the_emulator(tmp_path: Path) -> None:
    """No second emulator takes it; at SIGTERM this one ends with 0, truth written, link gone."""
    cell = Cell(tmp_path)
    port = (tmp_path / "arm").readlink()
    second = CliRunner().invoke(main, ["emulate", "--link", str(tmp_path / "arm")])
    assert (second.exit_code, second.stdout) == (Exit.USAGE, "")
    assert "another emulator keeps the link" in second.stderr
    assert (tmp_path / "arm").readlink() == port
    assert cell.end() == 0
    assert not (tmp_path / "arm").is_symlink()
    assert json.loads((tmp_path / "truth.json").read_text())["simulated"] is True


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--fault", "smoke"], "no fault 'smoke'"),
        (["--fault", "silence:p=2"], "p is 0 to 1"),
        (["--fault", "silence:after=1,after=3"], "after stands twice"),
        (["--time-scale", "0"], "--time-scale"),
        (["--time-scale", "nan"], "no finite number"),
        (["--truth", "/no/such/folder/truth.json"], "is no folder"),
        (["--baud", "14400"], "--baud"),
        (["--link", __file__], "is no link"),
        (["--config", "no-such.toml"], "no-such.toml"),
    ],
)
def test_wrong_words_are_refused_before_a_port_is_made(options: list[str], says: str) -> None:
    """Exit 2 with what is wrong, and nothing on stdout but that."""
    result = CliRunner().invoke(main, ["emulate", *options])
    assert result.exit_code == Exit.USAGE
    assert result.stdout == ""
    assert says in result.stderr


def test_without_a_file_the_truth_is_a_line_of_its_own(tmp_path: Path) -> None:
    """With --json the port comes first and the truth last; SIGINT ends it as well as SIGTERM."""
    config = configuration(tmp_path)
    command = [sys.executable, "-m", "legato.cli.leash", "emulate", "--config", str(config)]
    env = os.environ | {"LEGATO_PARENT": str(os.getpid())}
    with subprocess.Popen([*command, "--json"], env=env, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert list(json.loads(process.stdout.readline())) == ["port"]
        process.send_signal(signal.SIGINT)
        (line,) = process.communicate(timeout=20.0)[0].splitlines()
    assert process.returncode == 0
    assert json.loads(line)["truth"]["touches"] == []


def test_a_late_reply_does_not_hold_up_the_end(tmp_path: Path) -> None:
    """SIGTERM cuts every wait short, whatever the emulator is at."""
    cell = Cell(tmp_path, "late:by=100000,on=read")
    fd = os.open(tmp_path / "arm", os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(fd, b"@RESET\r")
        assert os.read(fd, 1) == b"1"
        os.write(fd, b"@READ\r")
        assert cell.end() == 0
    finally:
        os.close(fd)
    assert json.loads((tmp_path / "truth.json").read_text())["account"]["commands"]["other"] == 1
