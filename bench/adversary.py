"""No wrong pose accepted: 2,000 pictures drawn to mislead, and fair ones, through the whole chain.

Wrong means off by more than 1 deg or 1 mm at a station, in the robot's frame; where there is no
leg, any acceptance is wrong.
"""

import multiprocessing
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from bench.row import Row, keep
from bench.vision.cases import Draw
from bench.vision.chain import verify
from bench.vision.kinds import FAIR, KINDS, UNKNOWABLE

KNOWABLE = """
## What gives a wrong pose away

- A wrong intrinsics file: ten marks close before the camera show so much perspective that they
  would themselves tell alpha and principal point. `camera` asks what letting the camera go free
  would save in chi-square; `noise` and the held-out marks say the same less sharply.
- A leg of another size: from farther off it makes the same picture. Its marks do not: they come
  from a printer, and `mark size` measures their outlines to about 0.05 % together.
- Misplaced marks, another cone, a flipped picture: the residuals are no noise. One or two marks
  that the others contradict beyond doubt are left out and named.
- Something that moved: `second picture` solves the second picture by itself and compares in mm.

The ten marks are symmetric about a plane at 67.5 deg round the axis: a mirrored leg is the leg
itself, turned. Only a mirrored picture is wrong, and the principal point gives it away.

## What cannot be known

- A leg of another size whose marks have that size too is the same picture from another distance.
  One camera cannot tell. `table` refuses it where its lowest point would lie under the table or
  high over it, which at the paper's camera (50 mm over the table) takes some 8 % of size.
- A camera that was moved after the cell was measured sees the leg moved. `table` tells a part of
  it. Measure the camera's place anew after any knock; a fixed mark on the table in each picture
  would tell it, and is not built.
- A second leg of which fewer than five marks can be seen is not noticed, and the leg in full view
  is taken.
"""
LARGEST_DEG, LARGEST_MM = 1.0, 1.0
PROCESSES = 2
ALL: Mapping[str, tuple[Draw, int]] = {**FAIR, **KINDS, **UNKNOWABLE}


@dataclass(frozen=True)
class Trial:
    """One pair's verdict; errors are None where nothing was solved or there is no leg."""

    kind: str
    number: int
    accepted: bool
    wrong: bool
    error_deg: float | None
    error_mm: float | None
    reasons: tuple[str, ...]
    seconds: float


def run() -> list[Row]:
    """Run every kind and return what was accepted wrongly, and what was refused."""
    trials = trial_all({kind: count for kind, (_, count) in ALL.items()})
    tables = {kind: table(kind, [t for t in trials if t.kind == kind]) for kind in ALL}
    drawn = [t for t in trials if t.kind in KINDS]
    fair = [t for t in trials if t.kind in FAIR]
    refused = [t for t in fair if not t.accepted]
    rows = [
        Row("adversary: pictures drawn to mislead", len(drawn), "", 2000, at_least=True),
        Row("adversary: wrong poses accepted of them", sum(t.wrong for t in drawn), "", 0),
        Row(
            "adversary: worst station of an accepted pose",
            max((t.error_mm or 0.0 for t in drawn if t.accepted), default=0.0), "mm", LARGEST_MM,
        ),
        Row("adversary: wrong poses accepted of fair ones", sum(t.wrong for t in fair), "", 0),
        Row(
            f"adversary: share of {len(fair)} fair pictures refused",
            100.0 * len(refused) / len(fair), "%", 1.0,
        ),
        *(
            Row(f"adversary: {kind}: wrong of {count}", tables[kind]["wrong"], "",
                note="cannot be known from the pictures of one camera")
            for kind, (_, count) in UNKNOWABLE.items()
        ),
    ]  # fmt: skip
    wrong = [asdict(t) for t in trials if t.wrong]
    keep("adversary", rows, kinds=tables, wrong=wrong, refused_fair=[asdict(t) for t in refused])
    write_table(tables)
    return rows


def trial_all(counts: Mapping[str, int]) -> list[Trial]:
    """Return the trials of all kinds, run by two processes."""
    tasks = [(kind, n) for kind, count in counts.items() for n in range(count)]
    with multiprocessing.get_context("spawn").Pool(PROCESSES) as pool:
        return pool.starmap(trial, tasks, chunksize=8)


def trial(kind: str, number: int) -> Trial:
    """Draw a kind's picture pair of a number and run the chain on it."""
    import cv2

    cv2.setNumThreads(1)
    rng = np.random.default_rng([list(ALL).index(kind), number])
    case = ALL[kind][0](rng)
    began = time.perf_counter()
    verdict = verify(case.settings, case.first, case.second, case.picks)
    seconds = time.perf_counter() - began
    deg = mm = None
    if verdict.calibration is not None and case.truth is not None:
        legs = [t for t in (case.truth, case.other) if t is not None]
        deg, mm = min((verdict.errors(t) for t in legs), key=lambda e: e[1])
    off = deg is None or mm is None or deg > LARGEST_DEG or mm > LARGEST_MM
    return Trial(
        kind, number, verdict.accepted, verdict.accepted and off, deg, mm, verdict.reasons, seconds
    )


def table(kind: str, trials: list[Trial]) -> dict[str, Any]:
    """Return one kind's counts and its worst accepted pose."""
    accepted = [t for t in trials if t.accepted]
    return {
        "what": (ALL[kind][0].__doc__ or "").split("\n")[0].removeprefix("Draw "),
        "pictures": len(trials),
        "accepted": len(accepted),
        "wrong": sum(t.wrong for t in trials),
        "worst_accepted_mm": max((t.error_mm or 0.0 for t in accepted), default=None),
        "worst_accepted_deg": max((t.error_deg or 0.0 for t in accepted), default=None),
        "off_and_refused": sum(
            not t.accepted and t.error_mm is not None and t.error_mm > LARGEST_MM for t in trials
        ),
    }


def write_table(tables: Mapping[str, dict[str, Any]]) -> None:
    """Write docs/bench/adversary.md."""
    from bench.row import RESULTS

    lines = [
        "# Pictures drawn to mislead",
        "",
        "Each pair of pictures goes through capture, calibrate and verify as in a job. Wrong means",
        f"off by more than {LARGEST_DEG:g} deg or {LARGEST_MM:g} mm at a station. Made by",
        "`python -m bench adversary`.",
        "",
        "| kind | pictures | accepted | wrong | worst accepted mm | deg | solved wrong, refused |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind, t in tables.items():
        mm, deg = (
            "" if t[k] is None else f"{t[k]:.3f}"
            for k in ("worst_accepted_mm", "worst_accepted_deg")
        )
        note = " (cannot be known)" if kind in UNKNOWABLE else ""
        lines.append(
            f"| {kind}{note} | {t['pictures']} | {t['accepted']} | {t['wrong']} | {mm} | {deg} "
            f"| {t['off_and_refused']} |"
        )
    lines += ["", "What each kind is:", ""]
    lines += [f"- **{kind}**: {t['what']}" for kind, t in tables.items()]
    (RESULTS / "adversary.md").write_text("\n".join(lines) + "\n" + KNOWABLE, encoding="utf-8")
