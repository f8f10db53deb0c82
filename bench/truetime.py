"""The paper's published pose in true time: the whole job over the serial line at 9600 baud.

Real daemon, TeachMover's driver, emulator's pseudo-terminal; time is read off the bytes. Other work
on this machine only ever adds to it, so the quickest of a few runs counts; touches count in all.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from bench.passes import CHARACTER_S, chords, least_time, rms
from bench.ptypasses import STATIONS, STROKES, massage, touches
from bench.row import Row, keep
from legato.geometry.arm import ArmModel
from legato.records.trajectory import COMMANDED
from legato.wire.teachmover import Step
from legato.wire.teachmover_robot import CommandParser
from tests.system.emulated import Cell

RUNS = 3
DWELL_S = 1.0
PUBLISHED = {"scatter_mm": 0.0, "scatter_deg": 0.0}


def run() -> list[Row]:
    """Return where the touches lie, and the time of a massage over its floor."""
    runs = [
        massage(seed, PUBLISHED, scale=1.0, dwell_s=DWELL_S, look=on_the_line)
        for seed in range(RUNS)
    ]
    quickest = min((r["line"] for r in runs), key=lambda told: told["seconds"])
    rows = [*touches("truetime", runs), *timing(quickest)]
    keep("truetime", rows, runs_s=[r["line"]["seconds"] for r in runs])
    return rows


def on_the_line(cell: Cell, session: str) -> dict[str, Any]:
    """Return what the line says of a job in true time: its passes from first byte to last.

    Each row of the record is one motion on the line, in the same order.
    """
    rows, passed = cell.record(session).trajectory, cell.passed()
    moving = rows["why"] != ""
    motions = cell.motions()
    commands = CommandParser()
    commands.receive(b"".join(data for _, data in motions))
    moves = [command.move for command in commands.events() if isinstance(command, Step)]
    assert len(moves) == moving.sum(), "each motion is recorded"
    began, ended = motions[0][0], passed[-1][0]
    characters = sum(len(data) for t, _, data in passed if t >= began)
    commanded = np.stack([rows[name] for name in COMMANDED], axis=1)
    return {
        "seconds": ended - began,
        "floor": least_time(moves, list(rows["why"][moving])) + DWELL_S * STROKES * len(STATIONS),
        "busy": characters * CHARACTER_S / (ended - began),
        "chord": chords(ArmModel(), np.stack([commanded[:-1], commanded[1:]], axis=1)),
        "commands": len(moves) / len(STATIONS),
    }


def timing(told: dict[str, Any]) -> Iterator[Row]:
    """Yield the time of a whole massage at 9600 baud, over its floor, and its commands."""
    here = "truetime"
    yield Row(f"{here}: a set of passes and home", told["seconds"], "s", peer=told["floor"])
    yield Row(f"{here}: the same over its floor", told["seconds"] / told["floor"], "", 1.25)
    yield Row(f"{here}: share of time the line is busy", told["busy"], "")
    yield Row(f"{here}: chord error, worst", float(told["chord"].max()), "mm", 0.25)
    yield Row(f"{here}: chord error, rms", rms(told["chord"]), "mm")
    yield Row(f"{here}: commands a pass", told["commands"], "")
