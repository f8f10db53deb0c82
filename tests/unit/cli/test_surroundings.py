"""`legato check` beyond the configuration: daemon, keys, clock and camera, each with what to do."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from legato import __version__
from legato.cli.exits import Exit
from legato.cli.surroundings import clock, daemon, grabbed, synchronised
from legato.config.load import load
from legato.daemon.keys import make_keys
from legato.daemon.link import DaemonUnavailable, RpcError
from legato.hal.camera import Frame
from legato.hal.faults import Cause, DeviceError
from tests.unit.cli.samples import FakeDaemon, document, run, write_cell

NOW = datetime(2026, 11, 22, 12, tzinfo=UTC)
WELL = {"version": __version__, "state": "idle", "uptime_s": 9.0, "fault": None,
        "arm": {"connected": True, "referenced": True}, "camera": {"connected": True}}  # fmt: skip


@pytest.mark.parametrize(
    ("status", "ok", "said", "hint"),
    [
        (WELL, True, "state idle, up 9 s", ""),
        (WELL | {"version": "0.0.1"}, None, "is legato 0.0.1", "restart"),
        (WELL | {"state": "fault", "fault": {"text": "arm gone", "hint": "plug it"}}, False,
         "arm gone", "plug it; then `legato reset`"),
        (WELL | {"arm": {"connected": False}}, None, "arm is not connected", "plugged in"),
        (WELL | {"camera": {"connected": False}}, None, "camera is not connected", "plugged in"),
        (WELL | {"arm": {"connected": True}}, None, "not referenced", "legato reference"),
        (DaemonUnavailable("no daemon answers"), None, "none runs here", "legato serve"),
        (RpcError(-32002, "not authorised", None), False, "cannot be asked", ""),
    ],
)  # fmt: skip
def test_the_daemon_is_told_as_it_is(
    status: dict[str, Any] | Exception, ok: bool | None, said: str, hint: str
) -> None:
    """Running well, of another version, in fault, without a device, not there at all."""
    found = daemon(status)
    assert found.ok is ok
    assert said in found.text
    assert hint in found.hint


def test_a_clock_behind_the_records_is_wrong(tmp_path: Path) -> None:
    """Before the last session began it cannot be; unsynchronised it deserves a look."""
    loaded = load(write_cell(tmp_path))
    assert clock(loaded, NOW, True).ok is True
    assert clock(loaded, NOW, None).ok is True
    assert clock(loaded, NOW, False).ok is None
    folder = tmp_path / "state" / "sessions" / "20261123T000000Z-00aa"
    folder.mkdir(parents=True)
    found = clock(loaded, NOW, True)
    assert found.ok is False
    assert "before the last session began" in found.text


def test_the_kernel_is_asked_without_changing_anything() -> None:
    """It answers yes, no, or not at all, the same twice."""
    assert synchronised() in (True, False, None)
    assert synchronised() == synchronised()


class Webcam:
    """A camera that gives a picture, or fails as told."""

    simulated = False

    def __init__(self, error: DeviceError | None = None) -> None:
        self.error, self.closed = error, False

    def open(self) -> None:
        """Fail, where told."""
        if self.error is not None:
            raise self.error

    def grab(self) -> Frame:
        """Give a black picture."""
        return Frame(np.zeros((480, 640), dtype=np.uint8), 0.0, 1, "test")

    def close(self) -> None:
        """Remember."""
        self.closed = True


def test_a_camera_is_asked_for_a_picture_and_closed() -> None:
    """Its size is told; a camera that fails is told with its hint, and closed as well."""
    good, bad = Webcam(), Webcam(DeviceError(Cause.CAMERA_LOST, "no picture", "plug it in"))
    assert grabbed(good, "0").text == "640 x 480 px from 0"
    found = grabbed(bad, "0")
    assert (found.ok, found.text, found.hint) == (False, "no picture", "plug it in")
    assert good.closed
    assert bad.closed


def test_keys_open_to_others_are_found(tmp_path: Path) -> None:
    """A daemon's secret that others can read is named with what to do; closed, it is well."""
    secret, _ = make_keys(tmp_path, "daemon", "operator")
    clients = tmp_path / "clients"
    clients.mkdir(mode=0o700)
    _, public = make_keys(tmp_path, "bench", "observer")
    (clients / public.name).write_bytes(public.read_bytes())
    (clients / public.name).chmod(0o644)
    table = f"[server]\ncurve = {{secret = '{secret}', clients = '{clients}'}}\n"
    cell = write_cell(tmp_path, table)
    found = {c["name"]: c for c in document(run("check", "--config", cell, "--json"))["checks"]}
    assert found["keys"]["ok"] is True
    assert "bench" in found["keys"]["text"]
    secret.chmod(0o644)
    result = run("check", "--config", cell, "--json")
    assert result.exit_code == Exit.FAILED
    found = {c["name"]: c for c in document(result)["checks"]}
    assert found["keys"]["ok"] is False
    assert "chmod 600" in found["keys"]["hint"] + found["keys"]["text"]


def test_a_person_gets_what_to_do_under_each_finding(tmp_path: Path) -> None:
    """The fault of a running daemon stands with its hint below, and a verdict at the end."""
    fault = {"text": "arm gone", "hint": "plug it"}
    running = FakeDaemon({"status": WELL | {"state": "fault", "fault": fault}})
    result = run("check", "--config", write_cell(tmp_path), daemon=running)
    assert result.exit_code == Exit.FAILED
    lines = result.stdout.splitlines()
    at = next(i for i, line in enumerate(lines) if "arm gone" in line)
    assert lines[at].startswith("NO")
    assert "what to do: plug it" in lines[at + 1]
    assert "1 to be put right" in lines[-1]
