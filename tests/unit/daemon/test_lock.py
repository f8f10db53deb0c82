"""The lock: one daemon a state folder, and none left behind by the dead."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from legato.daemon.lock import AlreadyRunning, look, only_instance

HOLD = """
import sys
from pathlib import Path
from legato.daemon.lock import only_instance
with only_instance(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_second_one_is_refused_with_the_first_ones_process(tmp_path: Path) -> None:
    """While one holds the lock another is told who; afterwards it gets it."""
    folder, me = tmp_path / "new", str(os.getpid())
    with (
        only_instance(folder),
        pytest.raises(AlreadyRunning, match=me),
        only_instance(folder),
    ):
        pass
    with only_instance(folder):
        pass


def test_a_look_tells_who_is_there_and_leaves_nothing(tmp_path: Path) -> None:
    """Without a lock or a holder it is silent, and it holds and makes nothing."""
    look(tmp_path / "nowhere")
    assert not (tmp_path / "nowhere").exists()
    with only_instance(tmp_path), pytest.raises(AlreadyRunning, match=str(os.getpid())):
        look(tmp_path)
    look(tmp_path)
    with only_instance(tmp_path):
        pass


def test_a_killed_holder_leaves_no_lock(tmp_path: Path) -> None:
    """The kernel lets go of a dead process's lock."""
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    with holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(AlreadyRunning), only_instance(tmp_path):
            pass
        holder.kill()
    with only_instance(tmp_path):
        pass
