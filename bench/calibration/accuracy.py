"""Optimum found, and error against the Cramer-Rao bound at the truth, for every way in every cell.

A cell is a set of marks, a noise, and intrinsics known or free. With 200 scenes an rms has a
sampling error of 4 to 5 %: it is given, beside it that of 2,000 scenes, and the excess over the
bound with the error of the best linear estimator on the very same noise taken out.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from multiprocessing import Pool
from typing import Any

import numpy as np

from bench.calibration.peers import Answer, multistart
from bench.calibration.scenes import SETS, SIGMAS, Scene, scene
from bench.calibration.ways import OURS, SLOW, WAYS
from bench.row import Row
from legato.calibration.cost import prepare
from legato.calibration.uncertainty import covariance_of, observed_jacobian
from legato.geometry.projection import project
from legato.geometry.transforms import Array

Table = Mapping[str, Mapping[str, Any]]

SCENES, MANY = 200, 2000
SLOW_SCENES = {"paper": 1, "scipy DE + LM": 3, "scipy DE, 100 generations, + LM": 4}
MOST_OVER_BOUND = 1.08
# As near as costs of one optimum come out by different programs.
SAME, SAME_PX2 = 1e-6, 1e-9


@dataclass(frozen=True)
class Cell:
    """One cell of the table."""

    marks: str
    sigma: float
    known: bool

    @property
    def name(self) -> str:
        """Return the cell in words."""
        return f"{self.marks}, {self.sigma:g} px, {'known' if self.known else 'free'}"

    def scene(self, number: int) -> Scene:
        """Return one of its scenes."""
        seed = (3, list(SETS).index(self.marks), SIGMAS.index(self.sigma), int(self.known), number)
        return scene(seed, SETS[self.marks], self.sigma)


CELLS = [Cell(*c) for c in product(SETS, SIGMAS, (True, False))]


def measure(processes: int = 2) -> dict[str, dict[str, Any]]:
    """Return the figures of all cells by name; no time is measured here."""
    with Pool(processes) as pool:
        return dict(
            zip([c.name for c in CELLS], pool.map(figures, CELLS, chunksize=1), strict=True)
        )


def figures(cell: Cell) -> dict[str, Any]:
    """Return a cell's figures for every way."""
    scenes = [cell.scene(k) for k in range(SCENES)]
    answers: dict[str, list[Answer | None]] = {}
    for name, way in WAYS.items():
        count = SLOW_SCENES[name] if name in SLOW else SCENES
        found = [way(s, cell.known, k) for k, s in enumerate(scenes[:count])]
        if any(a is not None for a in found):
            answers[name] = found
    reference = np.array([multistart(s, cell.known, k).cost for k, s in enumerate(scenes)])
    for found in answers.values():
        costs = [a.cost for a in found if a is not None and _inside(cell, a)]
        kept = [k for k, a in enumerate(found) if a is not None and _inside(cell, a)]
        reference[kept] = np.minimum(reference[kept], costs)
    bound, linear = bounds(scenes, cell.known)
    told = {
        name: _summary(scenes, found, reference, bound, linear) for name, found in answers.items()
    }
    if cell.known:
        for name, ratios in many(cell).items():
            for what, ratio in ratios.items():
                told[name][what]["many"] = ratio
    return told


def many(cell: Cell) -> dict[str, dict[str, float]]:
    """Return our engines' rms over the bound in so many scenes that chance hardly counts."""
    scenes = [cell.scene(k) for k in range(MANY)]
    floor = bounds(scenes, cell.known)[0].mean(axis=0)
    found = {}
    for name in OURS:
        answers = [WAYS[name](s, cell.known, k) for k, s in enumerate(scenes)]
        square = [
            (np.inf, np.inf) if a is None else np.square(s.errors(a.pose))
            for s, a in zip(scenes, answers, strict=True)
        ]
        rotation, translation = np.sqrt(np.mean(square, axis=0) / floor)
        found[name] = {"rotation_deg": float(rotation), "translation_mm": float(translation)}
    return found


def _inside(cell: Cell, answer: Answer) -> bool:
    """Say whether an answer keeps the bounds: one that does not is no rival for the optimum."""
    if cell.known:
        return True
    camera = answer.camera
    bounds = cell.scene(0).problem.bounds
    return all(
        low <= value <= high
        for value, (low, high) in (
            (camera.u0, bounds["u0"]),
            (camera.v0, bounds["v0"]),
            (answer.pose[0, 3], bounds["t_x"]),
            (answer.pose[1, 3], bounds["t_y"]),
            (answer.pose[2, 3], bounds["t_z"]),
        )
    )


def bounds(scenes: list[Scene], known: bool) -> tuple[Array, Array]:
    """Return the Cramer-Rao bound's squares (S, 2), rotation in deg and translation in mm.

    And likewise the squared error of the best linear estimator on each scene's own noise.
    """
    out, linear = [], []
    for s in scenes:
        problem, genes = s.of(known), s.genes(known)
        model = prepare(problem)
        covariance = covariance_of(problem, model, genes)
        noise = problem.pixels - project(s.camera, s.pose, problem.points)
        j = observed_jacobian(model.points, genes).reshape(-1, 10)
        step = covariance @ j.T @ (noise / problem.sigma[:, None] ** 2).reshape(-1)
        spread = np.diag(covariance)
        out.append([spread[4:7].sum(), spread[7:].sum()])
        linear.append([step[4:7] @ step[4:7], step[7:] @ step[7:]])
    degrees = np.array([np.degrees(1.0) ** 2, 1.0])
    return np.array(out) * degrees, np.array(linear) * degrees


def _summary(
    scenes: list[Scene],
    found: list[Answer | None],
    reference: Array,
    bound: Array,
    linear: Array,
) -> dict[str, Any]:
    """Return counts and rms of one way over its scenes; what gave no answer counts as infinite."""
    n = len(found)
    cost = np.array([np.inf if a is None else a.cost for a in found])
    optimum = cost <= reference[:n] * (1.0 + SAME) + SAME_PX2
    square = np.array(
        [
            (np.inf, np.inf) if a is None else np.square(s.errors(a.pose))
            for s, a in zip(scenes, found, strict=False)
        ]
    )
    out: dict[str, Any] = {"scenes": n, "optimum": int(optimum.sum())}
    floor = bound[:n].mean(axis=0)
    for i, what in enumerate(("rotation_deg", "translation_mm")):
        e, least = square[:, i], float(floor[i])
        answered = np.isfinite(e)
        out["answered"] = int(answered.sum())
        rms = float(np.sqrt(e.mean()))
        ratio = rms / np.sqrt(least)
        entry = {"rms": rms, "median": float(np.sqrt(np.median(e))), "bound": float(np.sqrt(least)),
                 "over_bound": float(ratio)}  # fmt: skip
        if answered.all():
            apart = e - linear[:n, i]
            sharp = np.sqrt(max(0.0, apart.mean() / least + 1.0))
            entry["standard_error"] = float(e.std() / np.sqrt(n) / least / (2.0 * ratio))
            entry["sharp"] = float(sharp)
            entry["sharp_error"] = float(apart.std() / np.sqrt(n) / least / (2.0 * max(sharp, 0.1)))
        out[what] = entry
    return out


def rows(table: Table) -> list[Row]:
    """Return the rows of the issue that speak of optima and bounds."""
    out = []
    for name in OURS:
        least = min(table[c.name][name]["optimum"] for c in CELLS)
        total = sum(table[c.name][name]["optimum"] for c in CELLS)
        out.append(
            Row(
                f"calibration: {name}, optimum found in the worst of {len(CELLS)} cells",
                least,
                "",
                SCENES,
                at_least=True,
                note=f"{total} of {SCENES * len(CELLS)} in all",
            )
        )
        for what in ("rotation_deg", "translation_mm"):
            out += _over_bound(table, name, what)
            out.append(_pooled(table, name, what))
            out.append(_against_peers(table, name, what))
    return out


def _over_bound(table: Table, name: str, what: str) -> list[Row]:
    """Return the worst cell with known intrinsics, as it came out and without sampling noise.

    The worst of nine cells of 200 scenes lies some 10 % over the bound for an estimator that is on
    it: the limit is held to what is left when that chance is taken out.
    """
    known = {c.name: table[c.name][name][what] for c in CELLS if c.known}
    raw = max(known, key=lambda c: known[c]["over_bound"])
    most = max(known, key=lambda c: known[c]["many"])
    sharp = max(known, key=lambda c: known[c]["sharp"])
    title = f"calibration: {name}, known, {what.split('_')[0]} over bound"
    peer = table[raw]["SQPNP + LM"][what]["over_bound"]
    f = known[sharp]
    return [
        Row(
            f"{title}, worst cell as drawn", known[raw]["over_bound"], "x",
            note=f"+-{known[raw]['standard_error']:.3f} ({raw}; SQPNP + LM there {peer:.3f})",
        ),
        Row(
            f"{title}, worst cell of {MANY} scenes", known[most]["many"], "x", MOST_OVER_BOUND,
            note=most,
        ),
        Row(
            f"{title}, worst cell, chance taken out", f["sharp"], "x", MOST_OVER_BOUND,
            note=f"+-{f['sharp_error']:.3f} ({sharp})",
        ),
    ]  # fmt: skip


def _pooled(table: Table, name: str, what: str) -> Row:
    """Return all cells with known intrinsics together."""
    parts = [table[c.name][name][what] for c in CELLS if c.known]
    ratio = float(np.sqrt(np.mean([p["over_bound"] ** 2 for p in parts])))
    error = float(np.sqrt(np.sum([p["standard_error"] ** 2 for p in parts])) / len(parts))
    return Row(
        f"calibration: {name}, known, {what.split('_')[0]} over bound, all cells",
        ratio, "x", MOST_OVER_BOUND, note=f"+-{error:.3f}, {SCENES * len(parts)} scenes",
    )  # fmt: skip


def _against_peers(table: Table, name: str, what: str) -> Row:
    """Return the largest rms, with free intrinsics, in units of the best peer's on 200 scenes."""
    worst, who = 0.0, ""
    for c in CELLS:
        if c.known:
            continue
        peers = {
            n: f[what]["rms"]
            for n, f in table[c.name].items()
            if n not in (*OURS, *SLOW) and f["scenes"] == SCENES
        }
        best = min(peers, key=lambda n: peers[n])
        ratio = table[c.name][name][what]["rms"] / peers[best]
        if ratio > worst:
            worst, who = ratio, f"{best} in {c.name}"
    return Row(
        f"calibration: {name}, free, {what.split('_')[0]} rms over the best peer's, worst cell",
        worst, "x", 1.0 + 1e-4, note=who,
    )  # fmt: skip
