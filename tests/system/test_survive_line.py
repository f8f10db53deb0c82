"""The same over the emulated arm's pseudo-terminal, where every byte to the arm is known."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.system import judge
from tests.system.attacked import SHORT, Attacked, attacked
from tests.system.emulated import Cell
from tests.system.killing import kill
from tests.system.line import Line, ready_to_massage

TABLES: dict[str, dict[str, Any]] = {
    name: table for name, table in SHORT.items() if name != "robot"
} | {"robot": {"reply_margin_s": 0.3}}


@contextmanager
def over_the_line(folder: Path, *faults: str) -> Iterator[tuple[Attacked, Cell, Line]]:
    """Give a daemon, the emulator that it drives, and a client."""
    emulator = Cell(folder, *faults, tables=TABLES)
    try:
        with attacked(folder, TABLES) as cell:
            line = Line(cell.lines["requests"])
            try:
                yield cell, emulator, line
            finally:
                line.close()
    finally:
        assert emulator.end() == 0


def sound(cell: Attacked, emulator: Cell, kills: list[float] | None = None) -> None:
    """See that records are sound, and that no motion was sent outside a motion state."""
    paths = judge.folders(cell.state_dir)
    assert list(judge.records(paths)) == []
    motions = [t for t, _ in emulator.motions()]
    assert motions
    assert list(judge.on_the_line(motions, paths, kills or [])) == []
    assert cell.logged("bug") == []


def test_killed_in_a_pass_nothing_more_comes_on_the_line(tmp_path: Path) -> None:
    """The arm lives on and hears of no motion until somebody resets and asks for one."""
    with over_the_line(tmp_path) as (cell, emulator, _):
        told = kill(cell, 1, emulator, longest_s=0.4, jobs=("run",), from_state="massage")
        assert told.wrong == []
        assert told.motions > 0


def test_frozen_in_a_pass_it_goes_on_where_it_was(tmp_path: Path) -> None:
    """A reply that came while the process was frozen counts; nothing is sent twice or in doubt."""
    with over_the_line(tmp_path) as (cell, emulator, line):
        ready_to_massage(line, lambda: emulator.truth()["tip"])
        session = line.do("massage")["session"]
        while line.do("status")["state"] != "massage_7":
            time.sleep(0.01)
        for _ in range(2):
            cell.send_signal(signal.SIGSTOP)
            time.sleep(0.8)
            cell.send_signal(signal.SIGCONT)
            time.sleep(0.03)
        assert line.outcome(session) == "done"
        assert line.do("status")["arm"]["referenced"]
        sound(cell, emulator)


def test_a_port_that_vanishes_and_comes_back(tmp_path: Path) -> None:
    """In a motion: fault `arm_lost`, and the arm has to be referenced again before it moves."""
    with over_the_line(tmp_path, "hang-up:after=60,by=0.6") as (cell, emulator, line):
        ready_to_massage(line, lambda: emulator.truth()["tip"])
        assert line.outcome(line.do("massage")["session"]) == "fault"
        status = line.do("status")
        assert status["fault"]["cause"] == "arm_lost"
        assert status["arm"]["connected"] is False
        assert line.ask("reset")["error"]["message"] == "unavailable"
        until = time.monotonic() + 20.0
        while "error" in line.ask("reset"):
            assert time.monotonic() < until
            time.sleep(0.1)
        assert "referenced" in line.ask("home")["error"]["data"]["reason"]
        line.do("reference", **emulator.truth()["tip"])
        assert line.outcome(line.do("home")["session"]) == "done"
        sound(cell, emulator)
