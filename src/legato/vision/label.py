"""Which candidate is which mark: poses from triples propose, all marks together decide.

A triple of candidates taken as three marks gives up to four poses (P3P); a pose is worth what it
explains: marks that face the camera near candidates whose edges run as a pasted mark's would.
The best poses are fitted, assigned one to one, and freed of their worst marks.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics, pinhole_pixels
from legato.geometry.transforms import Array
from legato.vision.hypotheses import (
    Target,
    candidate_triples,
    crowded,
    edges_fit,
    mark_triples,
    most_telling,
    poses_of,
    pronounced_triples,
    scale_of,
)
from legato.vision.marks import MarksNotFound
from legato.vision.saddle import Candidates
from legato.vision.view import SMALLEST_FACING, View, fit_view

LEAST_MARKS = 5  # named marks; fewer agree with a wrong pose too easily
ENOUGH_MARKS = 7  # so many never agree by chance: the search ends
ROUNDS = 16  # triples of marks tried
MOST_CONFIRMED = 6  # labellings of few marks that are held against the picture
CROWDED_ROUNDS = 10  # the same where places abound: each costs more
MOST_ROUNDS, BUDGET = 64, 16000  # more of them where candidates are few: their product
STRONG = 0.3  # of the fourth strongest contrast
RADII = (30.0, 14.0, 7.0, 5.0)  # px at width 768 of the successive assignments
LARGEST_RMS = 1.4  # px at width 768 of a consistent set


@dataclass(frozen=True)
class Labelling:
    """The view, the candidate (index) of each named mark, their misfit in px, and a worth.

    The worth is more for more marks named, fewer missing and a smaller misfit.
    """

    view: View
    chosen: dict[str, int]
    rms: float
    worth: float

    def indices(self, leg: Leg) -> dict[int, int]:
        """Return the candidates by the marks' places in the leg's order."""
        names = leg.names()
        return {names.index(name): k for name, k in self.chosen.items()}


Confirm = Callable[[Labelling], bool]


def label(
    candidates: Candidates,
    leg: Leg,
    nominal: Intrinsics,
    rng: np.random.Generator,
    prior: View | None = None,
    rounds: int | None = None,
    confirm: Confirm = lambda _: True,
) -> Labelling:
    """Return the labelling that explains most marks of one leg.

    `nominal` may be off by a tenth in alpha and some 20 px in the principal point. `prior` is a
    view known to be near, tried first; `rounds` sets how many triples of marks are tried;
    `confirm` says whether the picture bears a labelling out. Raises MarksNotFound where too few
    marks agree or two labellings explain the picture equally well.
    """
    if len(candidates) < LEAST_MARKS:
        raise MarksNotFound(
            f"only {len(candidates)} places in the picture look like marks, "
            f"{LEAST_MARKS} are needed",
            "see that the leg's marks are in the picture, in focus, lit and not covered",
            len(candidates),
        )
    best, found = _first_confirmed(candidates, Target.of(leg), nominal, rng, prior, rounds, confirm)
    if best is None:
        raise MarksNotFound(
            f"none of the poses tried explains {LEAST_MARKS} of the {len(candidates)} places "
            "that look like marks",
            "see that the leg model in the configuration is this leg, that the intrinsics are "
            "this camera's, and that at least seven marks are in sight; or give picks",
            len(candidates),
        )
    rival = next((r for r in found if _rivals(best, r) and confirm(r)), None)
    if rival is not None:
        raise MarksNotFound(
            f"two labellings explain the picture: {_text(best)} and {_text(rival)}",
            "show more marks, those on the big face above all, or give picks",
            len(candidates),
        )
    return best


def _first_confirmed(
    candidates: Candidates,
    target: Target,
    nominal: Intrinsics,
    rng: np.random.Generator,
    prior: View | None,
    rounds: int | None,
    confirm: Confirm,
) -> tuple[Labelling | None, list[Labelling]]:
    """Return the first labelling that names enough and is confirmed, else the best confirmed.

    And with it all that were found, by falling worth.
    """
    found: list[Labelling] = []
    seen: list[dict[str, int]] = []
    for found in _rounds(candidates, target, nominal, rng, prior, rounds):
        best = found[0]
        if len(best.chosen) >= ENOUGH_MARKS and best.chosen not in seen:
            seen.append(best.chosen)
            if confirm(best):
                return best, found
    return next((r for r in found[:MOST_CONFIRMED] if confirm(r)), None), found


def _rounds(
    candidates: Candidates,
    target: Target,
    nominal: Intrinsics,
    rng: np.random.Generator,
    prior: View | None,
    rounds: int | None,
) -> Iterator[list[Labelling]]:
    """Yield the labellings so far by falling worth: of the strong candidates first, then of all.

    A wood's figure or a distant floor shows many weak saddles; marks differ less among themselves.
    """
    limit = STRONG * float(np.sort(candidates.contrast)[-4])
    strong = np.flatnonzero(candidates.contrast >= limit)
    found: list[Labelling] = []
    if LEAST_MARKS < len(strong) < len(candidates):
        for part in _search(candidates.take(strong), target, nominal, rng, prior, rounds):
            found = [
                replace(x, chosen={n: int(strong[k]) for n, k in x.chosen.items()}) for x in part
            ]
            yield found
    for part in _search(candidates, target, nominal, rng, prior, rounds):
        yield _distinct(found + part)
    if crowded(len(candidates)) and rounds is None:
        # Marks may be among the most pronounced places and yet no neighbours of one another.
        for part in _search(candidates, target, nominal, rng, None, MOST_ROUNDS, pronounced=True):
            yield _distinct(found + part)


def _search(
    candidates: Candidates,
    target: Target,
    nominal: Intrinsics,
    rng: np.random.Generator,
    prior: View | None,
    rounds: int | None,
    pronounced: bool = False,
) -> Iterator[list[Labelling]]:
    """Yield what was found after each triple of marks, by falling worth.

    Each is tried on neighbours above all, or on the most `pronounced` candidates.
    """
    found: list[Labelling] = []
    tried: list[dict[int, int]] = []
    if prior is not None:
        expected = _settle(prior, candidates, target, nominal)
        found += [expected] if expected is not None else []
        if found:
            yield found
    pixels = pinhole_pixels(nominal, candidates.pixels)
    many = crowded(len(candidates)) and not pronounced
    most = _affordable(len(candidates)) if rounds is None else rounds
    for triple in mark_triples(target, most, many):
        chosen = (
            pronounced_triples(len(candidates))
            if pronounced
            else candidate_triples(candidates.pixels, rng)
        )
        poses = poses_of(target, triple, chosen, pixels, nominal)
        before = len(found)
        for pose in most_telling(poses, candidates, target, nominal):
            view = View(nominal, pose)
            first = _assigned(view, candidates, target, RADII[0] * scale_of(nominal))
            if len(first) < LEAST_MARKS - 1 or _contained(first, tried):
                continue
            settled = _settle(view, candidates, target, nominal)
            tried.append(first)
            if settled is not None:
                found.append(settled)
                tried.append(settled.indices(target.leg))
        if len(found) > before:
            found = _distinct(found)
            yield found


def _affordable(n: int) -> int:
    """Return how many triples of marks are worth trying with n candidates."""
    if crowded(n):
        return CROWDED_ROUNDS
    return min(MOST_ROUNDS, max(ROUNDS, BUDGET // (n * (n - 1) * (n - 2))))


def _settle(
    view: View, candidates: Candidates, target: Target, nominal: Intrinsics
) -> Labelling | None:
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
    named = {names[m]: n for m, n in sorted(chosen.items())}
    unseen = view.unseen(target.leg, 10.0)
    if len(named.keys() - unseen.keys()) < LEAST_MARKS:
        return None  # marks that could not be seen from there, say too far off
    missing = sum(1 for n in names if n not in unseen and n not in named)
    return Labelling(view, named, rms, len(named) - 0.5 * missing - 0.2 * rms)


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


def _distinct(found: list[Labelling]) -> list[Labelling]:
    """Return the labellings by falling worth, without repetitions."""
    kept: dict[tuple[tuple[str, int], ...], Labelling] = {}
    for item in sorted(found, key=lambda x: -x.worth):
        kept.setdefault(tuple(item.chosen.items()), item)
    return list(kept.values())


def _contained(assigned: dict[int, int], tried: list[dict[int, int]]) -> bool:
    """Say whether an assignment says nothing that an earlier one did not."""
    return any(assigned.items() <= earlier.items() for earlier in tried)


def _rivals(best: Labelling, other: Labelling) -> bool:
    """Say whether another labelling contradicts the best and explains as much."""
    names = {n: k for k, n in best.chosen.items()}
    contradictions = sum(1 for k, n in other.chosen.items() if names.get(n, k) != k)
    return contradictions >= 3 and other.worth > best.worth - 0.75


def _text(labelling: Labelling) -> str:
    """Return a labelling in words."""
    return f"{len(labelling.chosen)} marks at {labelling.rms:.1f} px"
