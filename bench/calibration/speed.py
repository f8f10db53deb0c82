"""CPU time of a solve on one core, one thread: medians, so that neighbours show less."""

import time
from collections.abc import Callable

import numpy as np

from bench.calibration.scenes import SETS, Scene, scene
from bench.calibration.ways import EVOLUTION, OURS, SETTINGS, SHORT_EVOLUTION, WAYS
from bench.row import Row
from legato.calibration.heldout import suspects
from legato.calibration.problem import EngineSettings
from legato.calibration.solve import solve

Times = dict[str, dict[str, dict[str, float]]]
Way = Callable[[Scene, bool, int], object]

SCENES, TRIALS = 20, 3
SLOW_SCENES = {"paper": 1, EVOLUTION: 2, SHORT_EVOLUTION: 5}
POPULATIONS = (200, 500, 1000, 2000, 4000)
GENERATIONS = 40
SIGMA = 0.5
MOST_MS = {"hybrid": 40.0, "separable": 15.0}
LEAST_QUICKER = 10.0
MOST_PAIR_STAGE_S = 1.5


def seconds(work: Callable[[], object]) -> float:
    """Return the processor's time that a piece of work takes, in s."""
    start = time.process_time()
    work()
    return time.process_time() - start


def times() -> Times:
    """Return the median in ms and the count by way and cell, all on the same scenes, by turns."""
    out: Times = {name: {} for name in WAYS}
    for index, (marks, names) in enumerate(SETS.items()):
        scenes = [scene((4, index, k), names, SIGMA) for k in range(SCENES)]
        for known in (True, False):
            taken: dict[str, list[float]] = {name: [] for name in WAYS}
            for k, s in enumerate(scenes):
                for name, way in WAYS.items():
                    if k < _count(name, known):
                        taken[name] += _quickest(way, s, known, k)
            cell = f"{marks}, {'known' if known else 'free'}"
            for name, found in taken.items():
                if found:
                    ms = 1e3 * float(np.median(found))
                    out[name][cell] = {"ms": ms, "scenes": len(found)}
    return out


def _count(name: str, known: bool) -> int:
    """Return how many scenes a way gets: with known intrinsics nothing is very slow."""
    return SCENES // 2 if known and name in SLOW_SCENES else SLOW_SCENES.get(name, SCENES)


def _quickest(way: Way, s: Scene, known: bool, k: int) -> list[float]:
    """Return the least of some trials, for what others do on the machine only adds; or nothing."""
    trials = []
    for _ in range(TRIALS):
        start = time.process_time()
        if way(s, known, k) is None:
            return []
        trials.append(time.process_time() - start)
    return [min(trials)]


def populations() -> dict[int, float]:
    """Return the time of a generation in ms, by population, of the paper's engine on ten marks."""
    problem = scene((4, 9, 0), SETS["ten"], SIGMA).problem
    out = {}
    for size in POPULATIONS:
        settings = EngineSettings(
            population=size, generations=GENERATIONS, stall_generations=GENERATIONS
        )
        taken = [
            seconds(lambda s=settings: solve(problem, "paper", s, np.random.default_rng(1)))  # type: ignore[misc]
            for _ in range(5)
        ]
        out[size] = 1e3 * min(taken) / GENERATIONS
    return out


def pair_stage() -> float:
    """Return the median time in s to find two swapped labels among ten, known and free alike."""
    taken = []
    for k in range(6):
        s = scene((4, 10, k), SETS["ten"], 0.25)
        s.problem.pixels[[3, 6]] = s.problem.pixels[[6, 3]]
        problem, rng = s.of(k % 2 == 0), np.random.default_rng(k)
        whole = solve(problem, "hybrid", SETTINGS, rng)
        taken.append(seconds(lambda: suspects(problem, whole, SETTINGS, rng)))  # noqa: B023 # called at once
    return float(np.median(taken))


def rows(table: Times, sizes: dict[int, float], pairs: float) -> list[Row]:
    """Return the rows of the issue that speak of time."""
    out = []
    for name in OURS:
        cell = max(table[name], key=lambda c: table[name][c]["ms"])
        out.append(
            Row(f"calibration: {name}, median solve, worst cell", table[name][cell]["ms"], "ms",
                MOST_MS[name], note=cell)
        )  # fmt: skip
        for kind in ("free", "known"):
            out.append(_quicker(table, name, kind))
    for name, cells in table.items():
        if name not in OURS and cells:
            ms = [f"{c}: {v['ms']:.2f} ms ({v['scenes']})" for c, v in cells.items()]
            middle = float(np.median([v["ms"] for v in cells.values()]))
            out.append(Row(f"calibration: {name}, median solve", middle, "ms", note="; ".join(ms)))
    growth = np.log(sizes[4000] / sizes[200]) / np.log(4000 / 200)
    note = ", ".join(f"{n}: {ms:.2f} ms" for n, ms in sizes.items())
    out.append(
        Row("calibration: growth of a generation's cost with N to", growth, "power", 1.0, note=note)
    )
    out.append(Row("calibration: two swapped marks of ten found", pairs, "s", MOST_PAIR_STAGE_S))
    return out


def _quicker(table: Times, name: str, kind: str) -> Row:
    """Return how many times quicker than scipy an engine is, in the cell where it is least so."""
    cells = [c for c in table[name] if c.endswith(kind)]
    ratio = {c: table[EVOLUTION][c]["ms"] / table[name][c]["ms"] for c in cells}
    short = min(table[SHORT_EVOLUTION][c]["ms"] / table[name][c]["ms"] for c in cells)
    cell = min(ratio, key=lambda c: ratio[c])
    return Row(
        f"calibration: {name}, {kind}, times quicker than scipy DE + LM",
        ratio[cell], "x", LEAST_QUICKER, at_least=True,
        note=f"{cell}; than scipy cut off at 100 generations {short:.1f}",
    )  # fmt: skip
