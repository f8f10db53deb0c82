"""Clients of a daemon that dies, freezes and comes back: nothing lost, nothing goes on unseen."""

import os
import signal
import time
from pathlib import Path

import pytest

from legato.daemon.client import Client, DaemonUnavailable
from tests.system.process import configuration, daemon


def lines(folder: Path) -> dict[str, str]:
    """Return lines that a daemon has again after a restart."""
    return {name: f"ipc://{folder}/{name}" for name in ("requests", "events", "stop")}


def test_a_client_outlives_the_daemon(tmp_path: Path) -> None:
    """Killed and started again, the daemon is found by the same client, which hears all of it."""
    at = lines(tmp_path)
    config = configuration(tmp_path, at, seed=1, time_scale=20.0)
    with Client(at["requests"], at["events"]) as client:
        with daemon(config) as first:
            boot = client.call("ping")["boot"]
            session = client.call("run", key="tonight")["session"]
            first.process.kill()
            first.process.wait()
            with pytest.raises(DaemonUnavailable):
                client.call("ping")
        before = [event for _, event in client.events(0.2)]
        assert {event["boot"] for event in before} == {boot}
        with daemon(config):
            client.call("ping")
            heard = [event for _, event in client.events(0.5)]
            seqs = [event["seq"] for event in heard if event["boot"] != boot]
            assert seqs == list(range(1, len(seqs) + 1))
            states = [event["state"] for event in heard if event["topic"] == "state"]
            assert states[-1] == "fault"
            # Sent again after the crash, the job is the one that was interrupted: nothing moves.
            assert client.call("run", key="tonight")["session"] == session
            assert client.call("wait", session=session)["outcome"] == "interrupted"
            assert client.lost == 0


def test_a_frozen_daemon_pauses_for_the_operator_it_lost(tmp_path: Path) -> None:
    """The time for which a process was frozen counts: the lease has ended, the arm holds."""
    at = lines(tmp_path)
    with (
        daemon(configuration(tmp_path, at, seed=1, time_scale=10.0)) as running,
        Client(at["requests"]) as client,
    ):
        told = client.lease(1.0, deadman=True)
        session = client.call("home")["session"]
        assert client.call("wait", session=session)["outcome"] == "done"
        session = client.call("run")["session"]
        while client.call("status")["state"] != "massage_7":
            time.sleep(0.02)
        os.kill(running.process.pid, signal.SIGSTOP)
        time.sleep(1.2)
        os.kill(running.process.pid, signal.SIGCONT)
        paused = running.event("state", state="paused")
        assert (paused["cause"], paused["by"]) == ("lease_lost", told["holder"])
        status = running.do("status")
        assert (status["lease"], status["arm"]["contact"]) == (None, False)
        running.do("stop")
        assert running.wait(session) == "stopped"
