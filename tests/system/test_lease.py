"""`legato lease` and a real daemon: its command acts, others are refused, then all may again."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from legato.daemon.client import Client
from tests.system.attacked import SHORT, attacked
from tests.system.line import Line


def test_the_cell_is_its_commands_alone(tmp_path: Path) -> None:
    """A job under it is done; another's is busy; a Ctrl-C ends the lease with the command."""
    with attacked(tmp_path, SHORT, time_scale=400.0) as cell:
        line = Line(cell.lines["requests"])
        legato = [sys.executable, "-m", "legato"]
        config = ["--config", str(cell.config)]
        script = f"{' '.join([*legato, 'home', *config])} && echo done && exec sleep 30"
        words = [*legato, "lease", *config, "sh", "-c", script]
        try:
            with subprocess.Popen(words, stdout=subprocess.PIPE, text=True,
                                  start_new_session=True) as leased:  # fmt: skip
                assert leased.stdout is not None
                while leased.stdout.readline() != "done\n":
                    assert leased.poll() is None
                assert line.ask("home")["error"]["message"] == "busy"
                assert line.do("status")["lease"]["deadman"] is False
                os.killpg(leased.pid, signal.SIGINT)
                leased.wait(20.0)
            assert line.do("status")["lease"] is None
            assert line.outcome(line.do("home")["session"]) == "done"
        finally:
            line.close()


def test_a_client_under_a_lent_lease_acts_and_does_not_renew_it(tmp_path: Path) -> None:
    """Whoever took it renews it; calls carry its token."""
    with attacked(tmp_path, SHORT) as cell, Client(cell.lines["requests"]) as owner:
        token = owner.lease(30.0)["lease"]
        with Client(cell.lines["requests"]) as borrower:
            borrower.under(token)
            left = owner.call("status")["lease"]["left_s"]
            assert borrower.call("home")["session"]
            assert borrower.call("status")["lease"]["left_s"] < left
        owner.release()
