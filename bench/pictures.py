"""Marks and poses from rendered pictures: 200 poses over the workspace, then spoilt pictures."""

import multiprocessing
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bench.row import RESULTS, Row, keep
from bench.vision.clutter import hiding, reflections, with_checkers
from bench.vision.scenes import (
    LEG,
    Truth,
    anywhere,
    camera_from_world,
    of_size,
    renderer,
    settings,
    sharp,
    true_camera,
)
from bench.vision.spoil import Spoil, expose
from legato.calibration.problem import CalibrationError
from legato.control.checks import picture_checks
from legato.control.perceive import solve_marks
from legato.geometry.projection import Intrinsics, project
from legato.geometry.transforms import Array, angle_between
from legato.hal.camera import Image
from legato.vision.marks import MarksNotFound, Picking
from legato.vision.pick import find_marks

POSES, SPOILT = 200, 40
PROCESSES = 2
MARK_PX, KNOWN_DEG, KNOWN_MM, FREE_DEG, FREE_MM = 0.03, 0.02, 0.05, 0.2, 0.6
WHOLE_MS = 250.0
CPU = "processor time of one core"
FEWEST = 7  # marks that every scene has in sight, after those that are hidden on purpose


@dataclass(frozen=True)
class Looked:
    """One picture's outcome: mark errors (px) with their sigmas, pose errors (deg, mm), seconds."""

    condition: str
    number: int
    why: str
    accepted: bool
    errors: Mapping[str, tuple[float, float]]
    known: tuple[float, float] | None
    free: tuple[float, float] | None
    picking_s: float
    solving_s: float


@dataclass(frozen=True)
class Condition:
    """How a scene becomes a picture, and how many marks are hidden in it."""

    spoil: Callable[[Truth, Intrinsics, np.random.Generator], Spoil]
    size: tuple[int, int] = (768, 576)
    clutter: int = 0
    hidden: int = 0


def plainly(**values: object) -> Callable[[Truth, Intrinsics, np.random.Generator], Spoil]:
    """Return a spoil that does not depend on the scene."""
    return lambda _truth, _camera, _rng: replace(Spoil(), **values)  # type: ignore[arg-type] # its fields


def moving(length: float) -> Callable[[Truth, Intrinsics, np.random.Generator], Spoil]:
    """Return a motion of a length in any direction."""
    return lambda _t, _c, rng: Spoil(motion=(length, rng.uniform(0.0, np.pi)))


CONDITIONS: Mapping[str, Condition] = {
    "as simulated": Condition(plainly()),
    "clutter: 30 checkers around": Condition(plainly(), clutter=30),
    "one mark hidden": Condition(lambda t, _c, r: Spoil(covers=hiding(t, r, 1)), hidden=1),
    "two marks hidden": Condition(lambda t, _c, r: Spoil(covers=hiding(t, r, 2)), hidden=2),
    "three marks hidden": Condition(lambda t, _c, r: Spoil(covers=hiding(t, r, 3)), hidden=3),
    "light falls off by 60 %": Condition(
        lambda _t, _c, r: Spoil(slant=(0.6, r.uniform(0.0, 2.0 * np.pi)))
    ),
    "glare over two marks": Condition(
        lambda t, _c, r: Spoil(glares=reflections(t, r, 2)), hidden=2
    ),
    "under-exposed to a third": Condition(plainly(gain=0.33)),
    "over-exposed by a third": Condition(plainly(gain=1.33)),
    "noise of 5 levels": Condition(plainly(noise=5.0)),
    "blur of 2 px": Condition(plainly(blur=2.0)),
    "motion of 3 px": Condition(moving(3.0)),
    "motion of 6 px": Condition(moving(6.0)),
    "JPEG 90": Condition(plainly(jpeg=90)),
    "JPEG 75": Condition(plainly(jpeg=75)),
    "JPEG 60": Condition(plainly(jpeg=60)),
    "640x480": Condition(plainly(), (640, 480)),
    "1280x960": Condition(plainly(), (1280, 960)),
    "1920x1080": Condition(plainly(blur=1.2), (1920, 1080)),
    "1920x1080, clutter, JPEG 75": Condition(plainly(blur=1.2, jpeg=75), (1920, 1080), 30),
}


def run() -> list[Row]:
    """Return the figures of the 200 poses, and a row for each way of spoiling."""
    first, *others = CONDITIONS
    timed = [look(first, n) for n in range(POSES)]
    tasks = [(name, n) for name in others for n in range(SPOILT)]
    with multiprocessing.get_context("spawn").Pool(PROCESSES) as pool:
        spoilt = pool.starmap(look, tasks, chunksize=4)
    rows = [*_marks(timed), *_poses(timed), *_times(timed)]
    tables = {first: condition_row(timed)}
    tables |= {name: condition_row([x for x in spoilt if x.condition == name]) for name in others}
    rows += [
        Row(f"pictures: {name}: share found", 100.0 * t["found"], "%", 95.0, at_least=True)
        for name, t in tables.items()
    ]
    rows.append(
        Row("pictures: largest mark error over its sigma", max(t["worst_ratio"] for t in
            tables.values()), "", 5.0)
    )  # fmt: skip
    missed = [(x.condition, x.number, x.why) for x in [*timed, *spoilt] if x.why]
    keep("pictures", rows, conditions=tables, marks=mark_table(timed), missed=missed)
    _write(tables, mark_table(timed), rows)
    return rows


def look(condition: str, number: int) -> Looked:
    """Draw, render and spoil one scene, and find the leg in it."""
    import cv2

    cv2.setNumThreads(1)
    how = CONDITIONS[condition]
    rng = np.random.default_rng([list(CONDITIONS).index(condition), number])
    camera = true_camera(*how.size)
    truth = anywhere(rng, true_camera(), FEWEST + how.hidden)
    image = picture(truth, camera, how, rng)
    believed = of_size(settings(), *how.size)
    began = time.process_time()
    try:
        picking = find_marks(image, believed.leg, believed.nominal, seed=1)
        picked = time.process_time()
        found = solve_marks(picking, believed, seed=1)
        done = time.process_time()
    except (MarksNotFound, CalibrationError) as error:
        return Looked(condition, number, str(error), False, {}, None, None, 0.0, 0.0)
    accepted = all(c.ok for c in picture_checks(found, believed))
    free = None
    if condition == "as simulated":
        loose = solve_marks(picking, settings("free"), seed=1)
        free = pose_errors(loose.solution.camera_from_object, truth)
    return Looked(
        condition, number, "", accepted, mark_errors(picking, truth, camera),
        pose_errors(found.solution.camera_from_object, truth), free, picked - began, done - picked,
    )  # fmt: skip


def picture(truth: Truth, camera: Intrinsics, how: Condition, rng: np.random.Generator) -> Image:
    """Return the picture of a scene under a condition."""
    pose, world = camera_from_world() @ truth.world_from_object, camera_from_world()
    behind = None
    if how.clutter:
        scenery = renderer(truth, camera).scenery(pose, world)
        behind = with_checkers(scenery, rng, how.clutter)
    return expose(sharp(truth, camera, behind), how.spoil(truth, camera, rng), rng)


def mark_errors(
    picking: Picking, truth: Truth, camera: Intrinsics
) -> dict[str, tuple[float, float]]:
    """Return each found mark's error (px, root mean square of u and v) and its sigma."""
    pose = camera_from_world() @ truth.world_from_object
    places = dict(zip(LEG.names(), project(camera, pose, LEG.points()), strict=True))
    return {
        n: (float(np.hypot(*(places[n] - (m.u, m.v))) / np.sqrt(2.0)), m.sigma)
        for n, m in picking.marks.items()
    }


def pose_errors(camera_from_object: Array, truth: Truth) -> tuple[float, float]:
    """Return a pose's error: rotation in deg and the leg's origin in mm."""
    true = camera_from_world() @ truth.world_from_object
    turn = np.degrees(angle_between(true[:3, :3], camera_from_object[:3, :3]))
    return float(turn), float(np.linalg.norm(true[:3, 3] - camera_from_object[:3, 3]))


def mark_table(looked: list[Looked]) -> dict[str, dict[str, float]]:
    """Return, by mark, how often it was found and its error rms and at most, px."""
    out = {}
    for name in LEG.names():
        errors = [x.errors[name][0] for x in looked if name in x.errors]
        out[name] = {"found": len(errors), "rms_px": rms(errors), "max_px": max(errors)}
    return out


def condition_row(looked: list[Looked]) -> dict[str, float]:
    """Return one condition's figures."""
    solved = [x for x in looked if x.known is not None]
    pairs = [pair for x in solved for pair in x.errors.values()]
    return {
        "pictures": len(looked),
        "found": len(solved) / len(looked),
        "accepted": sum(x.accepted for x in looked) / len(looked),
        "marks": statistics.fmean(len(x.errors) for x in solved),
        "mark_rms_px": rms([e for e, _ in pairs]),
        "worst_mark_px": max(e for e, _ in pairs),
        "worst_ratio": max(e / s for e, s in pairs),
        "pose_rms_deg": rms([x.known[0] for x in solved if x.known]),
        "pose_rms_mm": rms([x.known[1] for x in solved if x.known]),
        "worst_accepted_mm": max(
            (x.known[1] for x in solved if x.known and x.accepted), default=0.0
        ),
        "picking_ms": 1e3 * statistics.median(x.picking_s for x in solved),
    }


def _marks(looked: list[Looked]) -> list[Row]:
    return [
        Row(f"pictures: {name}, error rms of {int(t['found'])}", t["rms_px"], "px", MARK_PX)
        for name, t in mark_table(looked).items()
    ]


def _poses(looked: list[Looked]) -> list[Row]:
    rows = []
    for what, errors, deg, mm in (
        ("known", [x.known for x in looked if x.known], KNOWN_DEG, KNOWN_MM),
        ("free", [x.free for x in looked if x.free], FREE_DEG, FREE_MM),
    ):
        turns, shifts = ([e[k] for e in errors] for k in (0, 1))
        rows += [
            Row(f"pictures: {what} intrinsics, rotation rms", rms(turns), "deg", deg),
            Row(f"pictures: {what} intrinsics, translation rms", rms(shifts), "mm", mm),
            Row(f"pictures: {what} intrinsics, worst rotation", max(turns), "deg"),
            Row(f"pictures: {what} intrinsics, worst translation", max(shifts), "mm"),
        ]
    return rows


def _times(looked: list[Looked]) -> list[Row]:
    solved = [x for x in looked if x.known is not None]
    picking = 1e3 * statistics.median(x.picking_s for x in solved)
    whole = 1e3 * statistics.median(x.picking_s + x.solving_s for x in solved)
    return [
        Row("pictures: picking and refinement, median", picking, "ms", note=CPU),
        Row("pictures: a whole picture to a pose, median", whole, "ms", WHOLE_MS, note=CPU),
    ]


def _write(
    tables: Mapping[str, dict[str, float]],
    marks: Mapping[str, dict[str, float]],
    rows: list[Row],
) -> None:
    """Write docs/bench/pictures.md."""
    lines = [
        "# Marks and poses from rendered pictures",
        "",
        f"{POSES} poses over the workspace, then {SPOILT} a way of spoiling the picture, each with",
        f"at least {FEWEST} sound marks left in sight. Made by `python -m bench pictures`.",
        "",
        "Free intrinsics: alpha_u, alpha_v, u0, v0 are found from the one picture. k1 and k2 are",
        "not: ten marks cannot tell them. They are those of the camera's intrinsics file, or zero",
        "where there is none; here the file has them, off by what its covariance says.",
        "",
        "| mark | found | rms px | worst px |",
        "|---|---|---|---|",
        *(
            f"| {n} | {t['found']:.0f} | {t['rms_px']:.4f} | {t['max_px']:.3f} |"
            for n, t in marks.items()
        ),
        "",
        "| picture | found | accepted | marks | mark rms px | worst px | worst / sigma | pose deg "
        "| pose mm | worst accepted mm | picking ms |",
        "|---" * 11 + "|",
    ]
    for name, t in tables.items():
        lines.append(
            f"| {name} | {100 * t['found']:.0f} % | {100 * t['accepted']:.0f} % | {t['marks']:.1f} "
            f"| {t['mark_rms_px']:.3f} | {t['worst_mark_px']:.2f} | {t['worst_ratio']:.1f} "
            f"| {t['pose_rms_deg']:.4f} | {t['pose_rms_mm']:.4f} | {t['worst_accepted_mm']:.3f} "
            f"| {t['picking_ms']:.0f} |"
        )
    lines += ["", "```", *(row.line().rstrip() for row in rows), "```"]
    (RESULTS / "pictures.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def rms(values: list[float]) -> float:
    """Return the root mean square; infinite for none."""
    return float(np.sqrt(np.mean(np.square(values)))) if values else float("inf")
