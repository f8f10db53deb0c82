"""The shipped unit under a real systemd: process 1 of a container over this machine's own files.

Needs root and `systemd-nspawn` (Debian: systemd-container); what is written stays in memory. A job
is run under the unit's restrictions, stopped with the service, killed, and frozen.
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bench.row import Row, keep
from bench.unattended import UNIT

ROOT = Path(__file__).resolve().parent.parent
CONFIG = "/etc/legato/cell.toml"
PROGRAM = """\
#!/bin/sh
PYTHONPATH=/opt/project/src:/opt/packages exec /opt/python/bin/python3 -m legato "$@"
"""
SCALE = 20.0  # of the cell's time
UP_S, STOP_S, WATCHDOG_S = 60.0, 10.0, 30.0
NSPAWN = "systemd-nspawn"
OPERATORS = "/srv/operator"  # the operator's folder, inside


class Booted:
    """A systemd that runs as process 1, and what it says of the service."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self._process = process
        self._enter: tuple[str, ...] = ()
        until(lambda: self._children() != [], "process 1")
        self._enter = ("nsenter", "-t", self._children()[0], "-m", "-u", "-i", "-n", "-p", "-C")
        until(lambda: self.shown("ActiveState") == "active", "the service's start")

    def do(self, *command: str, check: bool = True) -> str:
        """Run a command inside and return its output."""
        done = subprocess.run(
            [*self._enter, *command], capture_output=True, text=True, timeout=120.0, check=False
        )
        if check and done.returncode != 0:
            raise AssertionError(f"{command}: {done.stdout}{done.stderr}")
        return done.stdout.strip()

    def shown(self, what: str) -> str:
        """Return a property of the service."""
        return self.do("systemctl", "show", "legato", "-p", what, "--value", check=False)

    def legato(self, *words: str) -> Any:
        """Run a command of legato inside and return its JSON, whatever code it ends with."""
        return json.loads(self.do("legato", *words, "--json", "--config", CONFIG, check=False))

    def in_a_pass(self) -> "subprocess.Popen[bytes]":
        """Begin a job, and return its command once the arm is at the leg."""
        self.do("systemctl", "reset-failed", "legato")
        if self.legato("status")["state"] == "fault":
            self.legato("reset")
        words = [*self._enter, "legato", "run", "--config", CONFIG]
        job = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        until(lambda: self.shown("StatusText").startswith("massage"), "a pass")
        return job

    def latest(self) -> str:
        """Return the outcome of the latest session."""
        return str(self.legato("sessions")[0]["outcome"])

    def _children(self) -> list[str]:
        pid = self._process.pid
        return Path(f"/proc/{pid}/task/{pid}/children").read_text().split()


def run() -> list[Row]:
    """Return what systemd and the service did."""
    if os.geteuid() != 0 or shutil.which(NSPAWN) is None:
        note = f"needs root and {NSPAWN}: apt-get install systemd-container; the last result stays"
        return [Row("booted: units started by a real systemd", 0, "", note=note)]
    with tempfile.TemporaryDirectory() as name, cell(Path(name)) as booted:
        rows = [*service(booted)]
    keep("booted", rows, unit_sha256=hashlib.sha256(UNIT.read_bytes()).hexdigest())
    return rows


def service(booted: Booted) -> Iterator[Row]:
    """Yield the figures of one life of the service."""
    version = booted.do("systemctl", "--version").split()[1]
    yield Row("booted: units started by a real systemd", 1, "", 1, at_least=True,
              note=f"systemd {version}")  # fmt: skip
    wrong: list[str] = []

    def see(what: str, got: object, wanted: object) -> None:
        wrong.extend([f"{what}: {got}"] if got != wanted else [])

    began = time.monotonic()
    booted.do("systemctl", "restart", "legato")
    yield Row("booted: a restart until READY=1", time.monotonic() - began, "s")
    see("capabilities", booted.do("sh", "-c", CAPABILITIES), "0000000000000000")
    see("a whole job", booted.legato("run")["outcome"], "done")

    job, began = booted.in_a_pass(), time.monotonic()
    booted.do("systemctl", "stop", "legato")
    yield Row("booted: the service's end in a pass", time.monotonic() - began, "s", STOP_S)
    job.wait()
    see("result of a stop", booted.shown("Result"), "success")
    booted.do("systemctl", "start", "legato")
    see("session of a stop", booted.latest(), "stopped")

    for what, signal, limit in (("kill", "KILL", UP_S), ("freeze", "STOP", WATCHDOG_S + UP_S)):
        took = struck(booted, signal, limit)
        yield Row(f"booted: ready again after a {what}", took, "s", limit)
        status = booted.legato("status")
        see(f"state after a {what}", status["state"], "fault")
        see(f"cause after a {what}", (status["fault"] or {}).get("cause"), "interrupted")
        see(f"session of a {what}", booted.latest(), "interrupted")
        see(f"restarts after a {what}", booted.shown("NRestarts"), "1")

    booted.do("systemctl", "reset-failed", "legato")
    booted.do("sh", "-ec", KEYED)
    status = json.loads(
        booted.do("legato", "status", "--json", "--config", f"{OPERATORS}/anna.toml")
    )
    see("state behind keys, the secret a credential", status["state"], "idle")
    plain = booted.do("legato", "status", "--config", CONFIG, check=False)
    see("what a plain client is told behind keys", plain, "")

    booted.do("sh", "-c", f"echo 'nonsense = 1' >> {CONFIG}")
    booted.do("systemctl", "restart", "legato", check=False)
    time.sleep(5.0)  # longer than RestartSec
    see("exit code of a refused configuration", booted.shown("ExecMainStatus"), "2")
    see("restarts of a refused configuration", booted.shown("NRestarts"), "0")
    yield Row("booted: what was not as designed", len(wrong), "", 0, note="; ".join(wrong))


def struck(booted: Booted, signal: str, limit_s: float) -> float:
    """Send the service a signal in a pass; return how long it takes until another is ready."""
    job, before, began = booted.in_a_pass(), booted.shown("MainPID"), time.monotonic()
    booted.do("systemctl", "kill", "-s", signal, "legato")
    until(lambda: booted.shown("MainPID") not in ("0", before), f"one after {signal}", limit_s)
    until(lambda: booted.shown("ActiveState") == "active", f"a start after {signal}")
    job.wait()
    return time.monotonic() - began


KEYED = f"""
mkdir -p {OPERATORS}
cd {OPERATORS}
legato reset || true
legato keygen --name cell --role server --out . > /dev/null
legato keygen --name anna --role operator --out . > /dev/null
install -D -m 600 cell.secret /etc/credstore/legato.server.secret
install -D -m 644 anna.public /etc/legato/clients/anna.public
cp /etc/legato/cell.toml anna.toml
echo '[server]' | tee -a anna.toml >> /etc/legato/cell.toml
echo 'curve = {{ secret = "server.secret", clients = "clients" }}' >> /etc/legato/cell.toml
echo 'client_secret = "anna.secret"' >> anna.toml
echo 'server_public = "cell.public"' >> anna.toml
cp /etc/legato/*-intrinsics.toml .
systemctl restart legato
"""
"""Keys as docs/howto/keys.md makes them, the daemon's secret a credential of systemd's."""

CAPABILITIES = "sed -n 's/^CapEff:\\t//p' /proc/$(systemctl show legato -p MainPID --value)/status"


@contextmanager
def cell(folder: Path) -> Iterator[Booted]:
    """Give a booted copy of this machine with the unit installed and enabled; it ends with this."""
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1g", "none", str(folder)], check=True)
    root, up, work = (folder / part for part in ("root", "up", "work"))
    process: subprocess.Popen[bytes] | None = None
    try:
        for part in (root, up, work):
            part.mkdir()
        options = f"lowerdir=/,upperdir={up},workdir={work}"
        subprocess.run(["mount", "-t", "overlay", "none", "-o", options, str(root)], check=True)
        installed(root)
        with (folder / "console").open("wb") as console:
            process = subprocess.Popen(booting(root), stdin=subprocess.DEVNULL, stdout=console,
                                       stderr=console)  # fmt: skip
        yield Booted(process)
    finally:
        if process is not None:
            process.terminate()
            process.wait(60.0)
        subprocess.run(["umount", "-q", str(root)], check=False)
        subprocess.run(["umount", str(folder)], check=True)


def booting(root: Path) -> list[str]:
    """Return the command that boots a folder; interpreter and project lie where all may read."""
    seen = {"python": sys.base_prefix, "packages": sysconfig.get_path("purelib"), "project": ROOT}
    binds = [f"--bind-ro={place}:/opt/{name}" for name, place in seen.items()]
    return [NSPAWN, "-D", str(root), "--boot", "--register=no", "--keep-unit", "--private-network",
            "--machine=cell", "--console=pipe", *binds]  # fmt: skip


def installed(root: Path) -> None:
    """Install the unit as docs/howto/unattended.md does, with the simulated cell."""
    etc = root / "etc"
    program = root / "usr/local/bin/legato"
    program.unlink(missing_ok=True)
    program.write_text(PROGRAM)
    program.chmod(0o755)
    for source, place in (("legato.service", "systemd/system/legato.service"),
                          ("legato.sysusers", "sysusers.d/legato.conf"),
                          ("legato.tmpfiles", "tmpfiles.d/legato.conf")):  # fmt: skip
        (etc / place).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "systemd" / source, etc / place)
    wants = etc / "systemd/system/multi-user.target.wants/legato.service"
    wants.parent.mkdir(exist_ok=True)
    wants.unlink(missing_ok=True)
    wants.symlink_to("/etc/systemd/system/legato.service")
    target = etc / "systemd/system/default.target"
    target.unlink(missing_ok=True)
    target.symlink_to("/lib/systemd/system/multi-user.target")
    for name in ("machine-id", "fstab"):
        (etc / name).unlink(missing_ok=True)
    (etc / "machine-id").touch()
    (etc / "legato").mkdir(exist_ok=True)
    shutil.copy(ROOT / "etc/sim-intrinsics.toml", etc / "legato")
    lines = [*configuration((ROOT / "etc/sim.toml").read_text().splitlines())]
    (root / CONFIG[1:]).write_text("\n".join(lines) + "\n")


def configuration(lines: list[str]) -> Iterator[str]:
    """Yield the simulated cell's configuration with the unit's folder, its time passing faster."""
    changed = {"state_dir": '"/var/lib/legato"', "time_scale": str(SCALE)}
    for line in lines:
        key = line.partition("=")[0].strip()
        yield f"{key} = {changed[key]}" if key in changed else line


def until(holds: Callable[[], bool], what: str, limit_s: float = UP_S) -> None:
    """Wait until something holds."""
    give_up = time.monotonic() + limit_s
    while not holds():
        if time.monotonic() > give_up:
            raise TimeoutError(f"{what} did not come within {limit_s:g} s")
        time.sleep(0.1)
