"""Which candidate is which mark: poses from triples propose, all marks together decide.

A triple of candidates taken as three marks gives up to four poses (P3P); a pose is worth what it
explains: marks that face the camera near candidates whose edges run as a pasted mark's would.
The best poses are fitted, assigned one to one, and freed of their worst marks.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, pinhole_pixels
from legato.geometry.transforms import Array
from legato.vision.hypotheses import (
    Target,
    candidate_triples,
    edges_fit,
    mark_triples,
    most_telling,
    poses_of,
    scale_of,
)
from legato.vision.marks import MarksNotFound
from legato.vision.saddle import Candidates
from legato.vision.view import SMALLEST_FACING, View, fit_view

LEAST_MARKS = 5  # named marks; fewer agree with a wrong pose too easily
ENOUGH_MARKS = 7  # so many never agree by chance: the search ends
ROUNDS = 16  # triples of marks tried
MOST_ROUNDS, BUDGET = 64, 16000  # more of them where candidates are few: their product
STRONG = 0.3  # of the fourth strongest contrast
RADII = (30.0, 14.0, 7.0, 5.0)  # px at width 768 of the successive assignments
LARGEST_RMS = 1.4  # px at width 768 of a consistent set


@dataclass(frozen=True)
class Labelling:
    """The view, the candidate (index) of each named mark, and their misfit in px."""

    view: View
    chosen: dict[str, int]
    rms: float

    def indices(self, leg: Leg) -> dict[int, int]:
        """Return the candidates by the marks' places in the leg's order."""
        names = leg.names()
        return {names.index(name): k for name, k in self.chosen.items()}

    def worth(self, missing: int) -> float:
        """Return more for more marks named, fewer missing and a smaller misfit."""
        return len(self.chosen) - 0.5 * missing - 0.2 * self.rms


def label(
    candidates: Candidates,
    leg: Leg,
    nominal: Intrinsics,
    rng: np.random.Generator,
    prior: View | None = None,
    rounds: int | None = None,
) -> Labelling:
    """Return the labelling that explains most marks of one leg.

    `nominal` may be off by a tenth in alpha and some 20 px in the principal point. `prior` is a
    view known to be near, tried first; `rounds` sets how many triples of marks are tried. Raises
    MarksNotFound where too few marks agree or two labellings explain the picture equally well.
    """
    if len(candidates) < LEAST_MARKS:
        raise MarksNotFound(
            f"only {len(candidates)} places in the picture look like marks, "
            f"{LEAST_MARKS} are needed",
            "see that the leg's marks are in the picture, in focus, lit and not covered",
            len(candidates),
        )
    target = Target.of(leg)
    found = _strong_first(candidates, target, nominal, rng, prior, rounds)
    if not found:
        raise MarksNotFound(
            f"none of the poses tried explains {LEAST_MARKS} of the {len(candidates)} places "
            "that look like marks",
            "see that the leg model in the configuration is this leg, that the intrinsics are "
            "this camera's, and that at least seven marks are in sight; or give picks",
            len(candidates),
        )
    best = found[0][1]
    rival = next((r for worth, r in found[1:] if _rivals(found[0], (worth, r))), None)
    if rival is not None:
        raise MarksNotFound(
            f"two labellings explain the picture: {_text(best)} and {_text(rival)}",
            "show more marks, those on the big face above all, or give picks",
            len(candidates),
        )
    return best


def view_of_named(named: Mapping[str, Array], leg: Leg, nominal: Intrinsics) -> View | None:
    """Return the view that most marks named at pixels (2,) agree with; None for fewer than four.

    Poses come from triples, so that one wrong name does not spoil the rest.
    """
    names = tuple(named)
    if len(names) < 4:
        return None
    target, pixels = Target.of(leg), np.array([named[n] for n in names])
    points, ideal = leg.points(names), pinhole_pixels(nominal, pixels)
    index = [leg.names().index(n) for n in names]
    best: tuple[float, View] | None = None
    for rows in combinations(range(len(names)), 3):
        triple = tuple(index[k] for k in rows)
        for pose in poses_of(target, triple, np.array([rows]), ideal, nominal):
            off = np.linalg.norm(View(nominal, pose).pixels(points) - pixels, axis=-1)
            value = float(np.minimum(np.nan_to_num(off, nan=np.inf), 30.0).sum())
            if best is None or value < best[0]:
                best = (value, View(nominal, pose))
    if best is None:
        return None
    off = np.linalg.norm(best[1].pixels(points) - pixels, axis=-1)
    near = off < max(30.0, 2.0 * float(np.median(off)))
    if near.sum() < 4:
        return best[1]
    return fit_view(best[1], nominal, points[near], pixels[near], 0.7, rounds=20)[0]


def _strong_first(
    candidates: Candidates,
    target: Target,
    nominal: Intrinsics,
    rng: np.random.Generator,
    prior: View | None,
    rounds: int | None,
) -> list[tuple[float, Labelling]]:
    """Return labellings by falling worth, of the strong candidates alone where they suffice.

    A wood's figure or a distant floor shows many weak saddles; marks differ less among themselves.
    """
    limit = STRONG * float(np.sort(candidates.contrast)[-4])
    strong = np.flatnonzero(candidates.contrast >= limit)
    if LEAST_MARKS < len(strong) < len(candidates):
        found = _search(candidates.take(strong), target, nominal, rng, prior, rounds)
        if found and len(found[0][1].chosen) > LEAST_MARKS:
            return [
                (worth, replace(x, chosen={n: int(strong[k]) for n, k in x.chosen.items()}))
                for worth, x in found
            ]
    return _search(candidates, target, nominal, rng, prior, rounds)


def _search(
    candidates: Candidates,
    target: Target,
    nominal: Intrinsics,
    rng: np.random.Generator,
    prior: View | None,
    rounds: int | None,
) -> list[tuple[float, Labelling]]:
    """Return labellings by falling worth; stops when one names enough."""
    found: list[tuple[float, Labelling]] = []
    tried: list[dict[int, int]] = []
    if prior is not None:
        expected = _settle(prior, candidates, target, nominal)
        found += [expected] if expected is not None else []
    pixels = pinhole_pixels(nominal, candidates.pixels)
    for triple in mark_triples(target, _affordable(len(candidates)) if rounds is None else rounds):
        if found and len(found[0][1].chosen) >= ENOUGH_MARKS:
            break
        chosen = candidate_triples(len(candidates), rng)
        poses = poses_of(target, triple, chosen, pixels, nominal)
        for pose in most_telling(poses, candidates, target, nominal):
            view = View(nominal, pose)
            first = _assigned(view, candidates, target, RADII[0] * scale_of(nominal))
            if len(first) < LEAST_MARKS - 1 or _contained(first, tried):
                continue
            settled = _settle(view, candidates, target, nominal)
            tried.append(first)
            if settled is not None:
                found.append(settled)
                tried.append(settled[1].indices(target.leg))
        found.sort(key=lambda item: -item[0])
        found = _distinct(found)
    return found


def _affordable(n: int) -> int:
    """Return how many triples of marks are worth trying with n candidates."""
    return min(MOST_ROUNDS, max(ROUNDS, BUDGET // (n * (n - 1) * (n - 2))))


def _settle(
    view: View, candidates: Candidates, target: Target, nominal: Intrinsics
) -> tuple[float, Labelling] | None:
    """Assign, fit and drop until the named marks agree; None where too few do."""
    scale = scale_of(nominal)
    chosen: dict[int, int] = {}
    for radius in RADII:
        chosen = _assigned(view, candidates, target, radius * scale)
        if len(chosen) < LEAST_MARKS - 1:
            return None
        view, misfit = _refit(view, chosen, candidates, target, nominal)
    rms = float(np.sqrt((misfit**2).sum(axis=1).mean()))
    while rms > LARGEST_RMS * scale and len(chosen) > LEAST_MARKS:
        worst = list(chosen)[int(np.argmax((misfit**2).sum(axis=1)))]
        del chosen[worst]
        view, misfit = _refit(view, chosen, candidates, target, nominal)
        rms = float(np.sqrt((misfit**2).sum(axis=1).mean()))
    if len(chosen) < LEAST_MARKS or rms > LARGEST_RMS * scale:
        return None
    names = target.leg.names()
    labelling = Labelling(view, {names[m]: n for m, n in sorted(chosen.items())}, rms)
    unseen = view.unseen(target.leg, 10.0)
    missing = sum(1 for n in names if n not in unseen and n not in labelling.chosen)
    return labelling.worth(missing), labelling


def _assigned(view: View, candidates: Candidates, target: Target, radius: float) -> dict[int, int]:
    """Return candidates by mark (indices), one to one, within `radius` px of the prediction."""
    from scipy.optimize import linear_sum_assignment

    pose = view.camera_from_object[None]
    d = np.linalg.norm(view.pixels(target.points)[:, None] - candidates.pixels, axis=-1)
    fits = edges_fit(pose, candidates, target, view.intrinsics)[0]
    ahead = target.facing(pose)[0] > SMALLEST_FACING
    open_ = np.asarray(fits & ahead[:, None] & (d < radius), dtype=bool)
    cost = np.where(open_, d, 10.0 * radius)
    rows, columns = linear_sum_assignment(cost)
    return {int(m): int(n) for m, n in zip(rows, columns, strict=True) if open_[m, n]}


def _refit(
    view: View,
    chosen: dict[int, int],
    candidates: Candidates,
    target: Target,
    nominal: Intrinsics,
) -> tuple[View, Array]:
    """Return the view fitted to the named marks, and their misfits."""
    points, pixels = target.points[list(chosen)], candidates.pixels[list(chosen.values())]
    return fit_view(view, nominal, points, pixels, 0.7, rounds=6)


def _distinct(found: list[tuple[float, Labelling]]) -> list[tuple[float, Labelling]]:
    """Return the labellings without repetitions."""
    kept: dict[tuple[tuple[str, int], ...], tuple[float, Labelling]] = {}
    for item in found:
        kept.setdefault(tuple(item[1].chosen.items()), item)
    return list(kept.values())


def _contained(assigned: dict[int, int], tried: list[dict[int, int]]) -> bool:
    """Say whether an assignment says nothing that an earlier one did not."""
    return any(assigned.items() <= earlier.items() for earlier in tried)


def _rivals(best: tuple[float, Labelling], other: tuple[float, Labelling]) -> bool:
    """Say whether another labelling contradicts the best and explains as much."""
    names = {n: k for k, n in best[1].chosen.items()}
    contradictions = sum(1 for k, n in other[1].chosen.items() if names.get(n, k) != k)
    return contradictions >= 3 and other[0] > best[0] - 0.75


def _text(labelling: Labelling) -> str:
    """Return a labelling in words."""
    return f"{len(labelling.chosen)} marks at {labelling.rms:.1f} px"
