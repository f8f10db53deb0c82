"""A picture to named marks: find, label, refine, look again; or the same from a person's picks.

What is not found is named with the reason. A mark that does not lie where the others and the leg
model put it is left out here; whether the rest is trustworthy is calibration's to say.
"""

from collections.abc import Mapping

import numpy as np

from legato.geometry.leg import Leg
from legato.geometry.projection import Intrinsics
from legato.geometry.transforms import Array, apply
from legato.vision.hypotheses import view_of_named
from legato.vision.label import Labelling, label
from legato.vision.marks import FoundMark, MarksNotFound, Picking
from legato.vision.overlay import NotThere
from legato.vision.picture import Grey
from legato.vision.refine import Refined, noise_of, polish_mark, refine_mark
from legato.vision.saddle import Candidates, find_saddles
from legato.vision.view import View, fit_view

LEAST_FOUND = 6  # measured marks
LEAST_SECOND = 5  # marks of a second leg
SECOND_ROUNDS = 3  # triples of marks tried for it
OTHER = 5.0  # px from every mark of the first leg
LARGEST_MISFIT = 0.8  # mm across the line of sight: marks are pasted by hand
LEAST_LIMIT = 1.2  # px: what a view may be wrong by, however far the leg
EDGE = 5.0  # px a mark's centre keeps from the picture's edge
PICK_REACH = 12.0  # px at width 768 that a person's pick may be off
SADDLE_SIGMA = 0.5  # px of a pick that only its saddle supports


def find_marks(
    image: Grey, leg: Leg, nominal: Intrinsics, *, seed: int = 0, prior: View | None = None
) -> Picking:
    """Return the leg's marks in a grey picture (H, W), found without a person.

    `nominal` are the camera's intrinsics, or a guess within a tenth in alpha and 20 px in the
    principal point. `seed` draws which of many clutter triples are tried. `prior` is a view known
    to be near. Raises MarksNotFound with what to do.
    """
    _check_size(image, nominal)
    candidates = find_saddles(image)
    rng = np.random.default_rng(seed)
    measured = _Measurements(image, leg, nominal, candidates)
    try:
        labelling = label(candidates, leg, nominal, rng, prior, confirm=measured.confirm)
    except MarksNotFound:
        if measured.done and max(len(found) for _, found, _ in measured.done) < LEAST_FOUND:
            raise measured.too_few() from None
        raise
    found, missing = measured.of(labelling)
    _check_single(candidates, labelling, found, measured, rng)
    return Picking({n: _found(r) for n, r in found.items()}, missing, len(candidates), "automatic")


class _Measurements:
    """What templates find of labellings, each measured once."""

    def __init__(self, image: Grey, leg: Leg, nominal: Intrinsics, candidates: Candidates) -> None:
        self.image, self.leg, self.nominal, self.candidates = image, leg, nominal, candidates
        self.done: list[tuple[Labelling, dict[str, Refined], dict[str, str]]] = []

    def of(
        self, labelling: Labelling, candidates: Candidates | None = None
    ) -> tuple[dict[str, Refined], dict[str, str]]:
        """Return the marks measured from a labelling (of other candidates), and those missing."""
        for known, found, missing in self.done:
            if known is labelling:
                return found, missing
        places = (candidates or self.candidates).pixels
        starts = {name: places[k] for name, k in labelling.chosen.items()}
        found, missing = _measured(self.image, self.leg, self.nominal, labelling.view, starts)
        self.done.append((labelling, found, missing))
        return found, missing

    def confirm(self, labelling: Labelling) -> bool:
        """Say whether enough of a labelling's marks look like marks seen from there."""
        return len(self.of(labelling)[0]) >= LEAST_FOUND

    def too_few(self) -> MarksNotFound:
        """Return the error of the labelling that came nearest."""
        _, found, missing = max(self.done, key=lambda item: len(item[1]))
        return MarksNotFound(
            f"only {len(found)} marks can be measured ({_reasons(missing)}), "
            f"{LEAST_FOUND} are needed",
            "see that marks are lit, in focus and not covered, or give picks",
            len(self.candidates),
        )


def snap_picks(
    image: Grey, leg: Leg, nominal: Intrinsics, picks: Mapping[str, tuple[float, float]]
) -> Picking:
    """Return the marks that a person named at `picks` (u, v), each snapped to the mark nearby.

    A pick with no mark near it goes to `missing`. Marks whose template does not fit keep the place
    of their saddle and say so by a large sigma. Raises MarksNotFound for names the leg does not
    have.
    """
    _check_size(image, nominal)
    unknown = [n for n in picks if n not in leg.marks]
    if unknown:
        raise MarksNotFound(
            f"the leg has no mark {', '.join(unknown)}", f"its marks are {', '.join(leg.names())}"
        )
    candidates = find_saddles(image, most=200)
    snapped, missing = _snapped(candidates, picks, nominal)
    marks = {n: FoundMark(float(p[0]), float(p[1]), SADDLE_SIGMA) for n, p in snapped.items()}
    view = view_of_named(snapped, leg, nominal)
    if view is not None:
        found, _ = _measured(image, leg, nominal, view, snapped)
        for n, r in found.items():
            if n in snapped and np.linalg.norm(r.pixel - snapped[n]) < 3.0:
                marks[n] = _found(r)
    for n in leg.names():
        if n not in picks:
            missing[n] = "not picked"
    return Picking(marks, missing, len(candidates), "picks")


def _measured(
    image: Grey, leg: Leg, nominal: Intrinsics, view: View, starts: Mapping[str, Array]
) -> tuple[dict[str, Refined], dict[str, str]]:
    """Return all marks that templates find around a view, and why the others are missing."""
    noise = noise_of(image)
    missing = view.unseen(leg, EDGE)
    found: dict[str, Refined] = {}
    for name in leg.names():
        if name in missing:
            continue
        try:
            found[name] = refine_mark(image, leg, view, name, noise, starts.get(name))
        except NotThere as reason:
            missing[name] = str(reason)
    view = _agreed(leg, nominal, view, found, missing)
    # The better view gives a second chance, from its own prediction.
    for name in [n for n in missing if n not in view.unseen(leg, EDGE)]:
        try:
            found[name] = refine_mark(image, leg, view, name, noise)
            del missing[name]
        except NotThere as reason:
            missing[name] = str(reason)
    for name, rough in list(found.items()):
        try:
            found[name] = polish_mark(image, leg, view, name, noise, rough)
        except NotThere as reason:
            missing[name] = str(reason)
            del found[name]
    _agreed(leg, nominal, view, found, missing)
    order = leg.names()
    return {n: found[n] for n in order if n in found}, {
        n: missing[n] for n in order if n in missing
    }


def _found(r: Refined) -> FoundMark:
    """Return a refined mark as picking gives it."""
    u, v = (float(x) for x in r.pixel)
    return FoundMark(u, v, r.sigma, r.size.ratio, r.size.sigma)


def _agreed(
    leg: Leg,
    nominal: Intrinsics,
    view: View,
    found: dict[str, Refined],
    missing: dict[str, str],
) -> View:
    """Return the view of the found marks, after moving those that contradict it to `missing`."""
    while len(found) >= 4:
        names = tuple(found)
        pixels = np.array([found[n].pixel for n in names])
        sigma = np.array([max(found[n].sigma, 0.1) for n in names])
        fitted, misfit = fit_view(view, nominal, leg.points(names), pixels, sigma, rounds=12)
        off = np.linalg.norm(misfit, axis=1)
        depth = apply(fitted.camera_from_object, leg.points(names))[:, 2]
        limit = np.maximum(LARGEST_MISFIT * fitted.intrinsics.alpha_u / depth, LEAST_LIMIT)
        worst = int(np.argmax(off / limit))
        if off[worst] <= limit[worst]:
            return fitted
        missing[names[worst]] = f"lies {off[worst]:.0f} px from where the leg model puts it"
        del found[names[worst]]
    return view


def _check_size(image: Grey, nominal: Intrinsics) -> None:
    """Refuse a picture of another size than the intrinsics'."""
    height, width = image.shape[:2]
    if (width, height) != (nominal.width, nominal.height):
        raise MarksNotFound(
            f"the picture is {width} x {height} px but the intrinsics belong to "
            f"{nominal.width} x {nominal.height}",
            "give pictures and intrinsics of the same camera and size",
        )


def _check_single(
    candidates: Candidates,
    labelling: Labelling,
    found: Mapping[str, Refined],
    measured: _Measurements,
    rng: np.random.Generator,
) -> None:
    """Refuse a picture whose other candidates make up a second leg."""
    own = np.array([r.pixel for r in found.values()])
    taken = set(labelling.chosen.values())
    away = np.linalg.norm(candidates.pixels[:, None] - own, axis=-1).min(axis=1)
    free = [k for k in range(len(candidates)) if k not in taken and away[k] > OTHER]
    rest = candidates.take(np.array(free, dtype=np.intp))
    if len(rest) < LEAST_SECOND:
        return

    def another(other: Labelling) -> bool:
        places = [r.pixel for r in measured.of(other, rest)[0].values()]
        apart = [float(np.linalg.norm(own - p, axis=-1).min()) > OTHER for p in places]
        return sum(apart) >= LEAST_SECOND

    try:
        other = label(
            rest, measured.leg, measured.nominal, rng, rounds=SECOND_ROUNDS, confirm=another
        )
    except MarksNotFound:
        return
    raise MarksNotFound(
        f"two legs are in sight, with {len(found)} and {len(other.chosen)} marks",
        "leave one leg model in the picture",
        len(candidates),
    )


def _snapped(
    candidates: Candidates, picks: Mapping[str, tuple[float, float]], nominal: Intrinsics
) -> tuple[dict[str, Array], dict[str, str]]:
    """Return each pick's nearest candidate (2,), no candidate twice, and why others have none."""
    reach = PICK_REACH * max(1.0, nominal.width / 768.0)
    snapped: dict[str, Array] = {}
    missing: dict[str, str] = {}
    taken: dict[int, str] = {}
    pairs = []
    for name, pick in picks.items():
        d = np.hypot(*(candidates.pixels - np.asarray(pick, dtype=float)).T)
        missing[name] = f"no mark within {reach:.0f} px of the pick"
        pairs += [(float(d[k]), name, int(k)) for k in np.flatnonzero(d <= reach)]
    for _, name, k in sorted(pairs):
        if name in snapped:
            continue
        if k in taken:
            missing[name] = f"the mark near the pick is {taken[k]}'s"
            continue
        taken[k], snapped[name] = name, candidates.pixels[k]
        del missing[name]
    return snapped, missing


def _reasons(missing: Mapping[str, str]) -> str:
    """Return the missing marks with their reasons in one line."""
    return "; ".join(f"{name} {reason}" for name, reason in missing.items())
