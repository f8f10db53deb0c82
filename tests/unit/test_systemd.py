"""The shipped unit: what it promises, and that its measured exposure is of this very file."""

import configparser
import hashlib
import json
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
UNIT = ROOT / "systemd" / "legato.service"


def directives() -> dict[str, list[str]]:
    """Return every key of the unit with all its values, in order."""
    found: dict[str, list[str]] = {}
    for line in UNIT.read_text(encoding="utf-8").splitlines():
        if "=" in line and not line.startswith("#"):
            key, _, value = line.partition("=")
            found.setdefault(key, []).append(value)
    return found


def test_its_exposure_was_measured_of_this_very_unit_and_is_low() -> None:
    """`python -m bench unattended` asks systemd-analyze; its kept result cannot go stale."""
    result = json.loads((ROOT / "docs/bench/unattended.json").read_text(encoding="utf-8"))
    now = hashlib.sha256(UNIT.read_bytes()).hexdigest()
    assert result["unit_sha256"] == now, "the unit has changed: run `python -m bench unattended`"
    rows = {row["name"]: row["value"] for row in result["rows"]}
    assert rows["unattended: exposure of the unit"] <= 1.5
    assert rows["unattended: complaints of systemd-analyze verify"] == 0


def test_a_real_systemd_has_started_this_very_unit() -> None:
    """`python -m bench booted` boots one: jobs, stop, kill, freeze and refusal went as designed."""
    result = json.loads((ROOT / "docs/bench/booted.json").read_text(encoding="utf-8"))
    now = hashlib.sha256(UNIT.read_bytes()).hexdigest()
    assert result["unit_sha256"] == now, "the unit has changed: run `python -m bench booted`"
    rows = {row["name"]: row["value"] for row in result["rows"]}
    assert rows["booted: units started by a real systemd"] == 1
    assert rows["booted: what was not as designed"] == 0


def test_zeromq_may_do_what_it_cannot_do_without() -> None:
    """It ends the process where its threads may not be scheduled, or addresses not be looked up."""
    unit = directives()
    assert unit["SystemCallFilter"][-1] == "sched_setscheduler"
    assert "AF_NETLINK" in unit["RestrictAddressFamilies"][0].split()
    assert unit["RestrictRealtime"] == ["yes"], "the scheduler's other classes stay out of reach"


def test_systemd_waits_watches_and_gives_up() -> None:
    """Type=notify with a watchdog; restarts have a budget; a refused configuration has none."""
    unit = directives()
    assert unit["Type"] == ["notify"]
    assert unit["NotifyAccess"] == ["main"]
    assert int(unit["WatchdogSec"][0]) >= 10
    assert unit["Restart"] == ["on-failure"]
    assert int(unit["StartLimitBurst"][0]) <= 5
    assert int(unit["StartLimitIntervalSec"][0]) > int(unit["RestartSec"][0]) * 5
    assert unit["RestartPreventExitStatus"] == ["2"]
    assert int(unit["TimeoutStopSec"][0]) > 30, "stopping has 30 s to retract"


def test_it_reaches_its_devices_and_keys_and_nothing_else() -> None:
    """Serial adapters and cameras by class and group, loopback only, keys as credentials."""
    unit = directives()
    assert unit["DevicePolicy"] == ["closed"]
    allowed = {value.split()[0] for value in unit["DeviceAllow"]}
    assert {"char-ttyUSB", "char-ttyACM", "char-video4linux"} <= allowed
    assert set(unit["SupplementaryGroups"][0].split()) == {"dialout", "video"}
    assert unit["IPAddressDeny"] == ["any"]
    assert unit["IPAddressAllow"] == ["localhost"]
    assert unit["LoadCredential"] == ["server.secret:legato.server.secret"]
    assert unit["StateDirectory"] == ["legato"]


def test_it_reads_as_a_unit() -> None:
    """Its sections are those of a service."""
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.read(UNIT, encoding="utf-8")
    assert parser.sections() == ["Unit", "Service", "Install"]
