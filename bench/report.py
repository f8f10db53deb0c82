"""A session's papers: how long `legato report`, `compare` and `export` take, and their size.

Each is a process of its own, from its start to its end, the best of three: what a person waits for.
On a machine that does other work too, the seconds of one core tell more than those on the wall.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bench.row import Row, keep

LONGEST_S = 3.0
LARGEST_MB = 3.0
TRIES = 3
SEEDS = (1, 2, 3, 4, 5)


def run() -> list[Row]:
    """Return time and size of each paper of five sessions of the simulated cell."""
    with tempfile.TemporaryDirectory() as folder:
        for seed in SEEDS:
            legato("demo", "--seed", str(seed), "--out", folder)
        rows = [
            *paper("report: HTML", folder, "report", "report.html"),
            *paper("report: PDF", folder, "report", "report.pdf", "--pdf"),
            *paper(
                "compare: five sessions", folder, "compare", "c.html", "--last", str(len(SEEDS))
            ),
            *paper("export: MCAP", folder, "export", "s.mcap", limited=False),
        ]
    keep("report", rows)
    return rows


def paper(
    name: str, folder: str, command: str, file: str, *options: str, limited: bool = True
) -> list[Row]:
    """Return how long one paper takes and how large it is."""
    out = Path(folder) / file
    words = (command, *options, "-o", str(out), "--state-dir", folder)
    wall, core = map(min, zip(*(legato(*words) for _ in range(TRIES)), strict=True))
    size = out.stat().st_size / 1e6
    return [
        Row(f"{name}, process and all", wall, "s", LONGEST_S if limited else None),
        Row(f"{name}, of one core", core, "s", LONGEST_S if limited else None),
        Row(f"{name}, size", size, "MB", LARGEST_MB if limited else None),
    ]


def legato(*words: str) -> tuple[float, float]:
    """Run one command; return the seconds it took on the wall and of a core."""
    one_thread = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    began, used = time.perf_counter(), core_s()
    command = [sys.executable, "-m", "legato", *words]
    subprocess.run(command, check=True, capture_output=True, env=one_thread)
    return time.perf_counter() - began, core_s() - used


def core_s() -> float:
    """Return the seconds that ended children had of a core."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime
