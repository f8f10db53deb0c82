"""`legato lease`: taken, renewed while a command runs, given back however that ends."""

import sys
from pathlib import Path

import pytest

from legato.cli.exits import Exit
from legato.daemon.client import RpcError
from tests.unit.cli.samples import FakeDaemon, run, write_cell

LOST = RpcError(-32006, "expired", {"reason": "this lease has ended"})


class Leased(FakeDaemon):
    """A daemon that gives leases, of which the first `renewals` are renewed."""

    renewals = 99

    def call(self, method: str, **params: object) -> object:
        """Answer as a daemon does."""
        self.asked.append((method, params))
        if "lease" in params and params["duration_s"]:
            self.renewals -= 1
            if self.renewals < 0:
                raise LOST
        return {"lease": "t0ken" if params["duration_s"] else None}


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """Return a simulated cell's file."""
    return write_cell(tmp_path)


def python(code: str) -> list[str]:
    """Return a command line."""
    return [sys.executable, "-c", code]


def test_a_command_has_the_token_and_its_code_is_the_end(cell: Path) -> None:
    """Its own options stay its own; afterwards the lease is given back."""
    daemon = Leased()
    code = "import os, sys; sys.exit(7 if os.environ['LEGATO_LEASE'] == 't0ken' else 1)"
    words = [*python(code), "--json", "--config", "x"]
    result = run("lease", "--deadman", "--config", cell, *words, daemon=daemon)
    assert result.exit_code == 7, result.output
    assert daemon.asked == [
        ("lease", {"duration_s": 10.0, "deadman": True}),
        ("lease", {"lease": "t0ken", "duration_s": 0.0}),
    ]
    assert daemon.closed


def test_a_command_that_a_signal_has_ended_has_a_shells_code(cell: Path) -> None:
    """A terminated command gives 128 and the signal's number."""
    words = python("import os, signal; os.kill(os.getpid(), signal.SIGTERM)")
    assert run("lease", "--config", cell, *words, daemon=Leased()).exit_code == 143


def test_it_is_renewed_while_the_command_runs(cell: Path) -> None:
    """Three times in each of its lives."""
    daemon = Leased()
    words = python("import time; time.sleep(1.0)")
    assert run("lease", "--seconds", "1", "--config", cell, *words, daemon=daemon).exit_code == 0
    renewed = [asked for _, asked in daemon.asked[1:-1]]
    assert len(renewed) >= 2
    assert all(asked == {"lease": "t0ken", "duration_s": 1.0, "deadman": False}
               for asked in renewed)  # fmt: skip


def test_a_lease_that_is_lost_is_told_and_not_given_back(cell: Path) -> None:
    """The command goes on to its end; then this one has failed, as its help says."""
    daemon = Leased()
    daemon.renewals = 0
    words = python("import time; time.sleep(0.6)")
    result = run("lease", "--seconds", "1", "--config", cell, *words, daemon=daemon)
    assert result.exit_code == Exit.FAILED
    assert "with 1 where the lease was lost" in run("lease", "--help").output
    assert "the lease is lost: expired (-32006): this lease has ended" in result.stderr
    assert daemon.asked[-1][1]["duration_s"] == 1.0


def test_a_command_that_is_none_gives_the_lease_back(cell: Path) -> None:
    """Nobody is kept out for nothing; the line says what could not be run, and why."""
    daemon = Leased()
    result = run("lease", "--config", cell, "/no/such/command", daemon=daemon)
    assert result.exit_code == Exit.USAGE
    assert "cannot run '/no/such/command': No such file or directory" in result.stderr
    assert daemon.asked[-1] == ("lease", {"lease": "t0ken", "duration_s": 0.0})


def test_under_the_token_commands_act_with_it(cell: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every command's client is told, by the environment."""

    class Told(FakeDaemon):
        token = ""

        def under(self, token: str) -> None:
            self.token = token

    monkeypatch.setenv("LEGATO_LEASE", "t0ken")
    daemon = Told()
    assert run("pause", "--config", cell, daemon=daemon).exit_code == 0
    assert daemon.token == "t0ken"
