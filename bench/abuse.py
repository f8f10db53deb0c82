"""Junk, kills, strangers, and what befalls it from outside: what the daemon and the arm then do."""

import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from bench.outside import ANSWER_S, deadlines, filled, frozen, over_the_line, stepped
from bench.process import secrets
from bench.row import Row, keep
from legato.daemon.keys import Keys
from tests.system.attacked import LINES, SHORT, attacked
from tests.system.killing import Killed, kill
from tests.system.pelting import Pelted, pelt
from tests.system.strangers import STRANGERS, overheard, refused

MESSAGES = 5000  # at each of a plain and an encrypted daemon
WARM = 1000  # messages after which buffers are as large as they get
KILLS = {"sim": 60, "line": 40}
BACK_S, GROWTH_MB = 3.0, 3.0
REFUSALS = 10  # of each stranger on each line
HANDSHAKES_S = 6.0  # half a handshake is given up after 5 s


def run() -> list[Row]:
    """Return what each abuse has led to."""
    with ProcessPoolExecutor(2) as pool:
        kills = list(pool.map(killed, KILLS))
        outside = [*pool.map(_rows, [deadlines, frozen, stepped, filled, strangers])]
    pelted = [thrown("plain"), thrown("CURVE")]
    rows = [*of_kills(kills), *second(), *(row for found in outside for row in found)]
    rows += [row for told in pelted for row in told]
    keep("abuse", rows, states={m: k.states for m, k in zip(KILLS, kills, strict=True)},
         wrong=[text for k in kills for text in k.wrong][:20])  # fmt: skip
    return rows


def _rows(scenario: Callable[[], Iterable[Row]]) -> list[Row]:
    return list(scenario())


def thrown(mode: str) -> list[Row]:
    """Return how a daemon takes thousands of messages that are none."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        keys: Keys | None = None
        tables = dict(SHORT)
        if mode == "CURVE":
            keys, server = secrets(folder)
            tables["server"] = server
        with attacked(folder / "cell", tables) as cell:
            pelt(cell, WARM, keys, seed=9)
            time.sleep(HANDSHAKES_S)
            before, files = cell.megabytes(), cell.descriptors()
            told = pelt(cell, MESSAGES, keys)
            time.sleep(HANDSHAKES_S)
            after, left = cell.megabytes(), cell.descriptors()
            alive = cell.process.poll() is None
            bugs = len(cell.logged("bug")) + len(cell.said())
    return [*of_junk(mode, told, alive), *(
        Row(f"abuse: {mode}, memory grown", after - before, "MB", GROWTH_MB, peer=after),
        Row(f"abuse: {mode}, files left open", left - files, "", 0),
        Row(f"abuse: {mode}, bugs in the log", bugs, "", 0),
    )]  # fmt: skip


def of_junk(mode: str, told: Pelted, alive: bool) -> Iterator[Row]:
    """Yield the figures of junk."""
    restarts = len(told.boots) - 1 + (not alive)
    late = 1e3 * np.percentile(told.late_s, 99)
    yield Row(f"abuse: {mode}, malformed messages", told.thrown.total(), "", MESSAGES,
              at_least=True, note=str(dict(told.thrown)))  # fmt: skip
    yield Row(f"abuse: {mode}, restarts", restarts, "", 0)
    yield Row(f"abuse: {mode}, status meanwhile, p99", float(late), "ms", 1e3 * ANSWER_S)
    yield Row(f"abuse: {mode}, status meanwhile, worst", 1e3 * max(told.late_s), "ms")


def killed(mode: str) -> Killed:
    """Kill a daemon again and again, in process or over the pseudo-terminal."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if mode == "sim":
            with attacked(folder, SHORT, time_scale=100.0) as cell:
                return kill(cell, KILLS[mode], longest_s=2.0)
        with over_the_line(folder) as (cell, emulator):
            return kill(cell, KILLS[mode], emulator, longest_s=2.5)


def of_kills(kills: list[Killed]) -> Iterator[Row]:
    """Yield the figures of kills."""
    back = [s for k in kills for s in k.answered_s]
    yield Row("abuse: kill -9 in a session", sum(k.kills for k in kills), "", 100, at_least=True,
              note=f"{kills[1].kills} over the pseudo-terminal")  # fmt: skip
    yield Row("abuse: what was wrong after a kill", sum(len(k.wrong) for k in kills), "", 0)
    yield Row("abuse: back after a kill, worst", max(back), "s", BACK_S)
    yield Row("abuse: back after a kill, median", float(np.median(back)), "s")
    yield Row("abuse: records with a tear", sum(k.torn for k in kills), "")
    yield Row("abuse: motions on the line before the kills", kills[1].motions, "", 1, at_least=True)


def strangers() -> Iterator[Row]:
    """Yield how soon those who may not come in are told so, and what they have heard by then."""
    with tempfile.TemporaryDirectory() as name:
        keys, server = secrets(Path(name))
        with attacked(Path(name) / "cell", {**SHORT, "server": server}) as cell:
            told, heard = [], b""
            for who in STRANGERS:
                for where in LINES:
                    told += [
                        refused(cell.lines[where], who, keys, events=where == "events")
                        for _ in range(REFUSALS)
                    ]
            for where in LINES:
                heard = max(heard, overheard(cell.lines[where]), key=len)
            logged = cell.turned_away_after(len(told) - 1)
            lines = len(cell.logged("turned_away"))
    yield Row("abuse: strangers refused by name", len(told), "", 9 * REFUSALS, at_least=True)
    yield Row("abuse: a stranger is told within, worst", max(told), "s", ANSWER_S)
    yield Row("abuse: refusals in the log", logged, "", len(told), at_least=True,
              note=f"in {lines} lines")  # fmt: skip
    yield Row("abuse: bytes that a plain peer hears, the greeting", len(heard), "B", 64)


def second() -> Iterator[Row]:
    """Yield how long a second daemon takes to say that there is a first."""
    with tempfile.TemporaryDirectory() as name, attacked(Path(name), SHORT) as cell:
        spent, clear = [], True
        for _ in range(5):
            began = time.monotonic()
            other = cell.second()
            spent.append(time.monotonic() - began)
            text = f"another legato daemon (process {cell.process.pid})"
            clear &= other.returncode == 1 and text in other.stderr
    yield Row("abuse: a second daemon ends after, worst of 5", max(spent), "s", 1.0)
    yield Row("abuse: and says which is the first", float(clear), "", 1, at_least=True)
