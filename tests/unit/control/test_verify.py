"""What verify accepts, and what it refuses: each fault by the test that is there for it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest

from legato.calibration.problem import GENES, CalibrationError, KnownIntrinsics
from legato.control.advice import advise, advise_marks
from legato.control.checks import Check, picture_checks, second_picture_check
from legato.control.document import document
from legato.control.doubt import mark_size
from legato.control.perceive import Calibration, solve_marks
from legato.control.settings import CalibrationSettings, CellSettings
from legato.control.verify import cell_checks, lowest_point
from legato.drivers.sim.settings import SimSettings
from legato.drivers.sim.world import drawn_pose
from legato.geometry.projection import Intrinsics
from legato.geometry.transforms import (
    Array,
    angles_from_rotation,
    rotation_from_angles,
    rotation_from_vector,
    transform,
)
from legato.vision.marks import FoundMark, Picking
from tests.unit.control.cell import cell_settings, picking_of

NOISE = 0.02  # px
COPLANAR = ("P2", "P3", "P4", "P5", "P6", "P7", "P9", "P10")


def leg_pose(seed: int = 1) -> Array:
    """Draw a leg as the simulated cell does."""
    return drawn_pose(SimSettings(), np.random.default_rng(seed))


def seen(
    settings: CellSettings, pose: Array, seed: int = 0, **moves: tuple[float, float]
) -> Picking:
    """Return the marks of a noisy picture; `moves` shifts some by px."""
    rng = np.random.default_rng(seed)
    marks = {}
    for name, mark in picking_of(settings, pose).marks.items():
        du, dv = rng.normal(0.0, NOISE, 2) + moves.get(name, (0.0, 0.0))
        marks[name] = replace(mark, u=mark.u + du, v=mark.v + dv, sigma=NOISE)
    return Picking(marks)


def only(picking: Picking, names: tuple[str, ...]) -> Picking:
    """Return the picking with these marks alone."""
    missing = {n: "hidden" for n in picking.marks if n not in names}
    return Picking({n: m for n, m in picking.marks.items() if n in names}, missing)


def solved(settings: CellSettings, picking: Picking) -> Calibration:
    """Return what the solver makes of marks."""
    return solve_marks(picking, settings, seed=1)


def failed(checks: list[Check]) -> set[str]:
    """Return the names of the tests that failed; each says why and what to do."""
    for check in checks:
        assert check.text
        assert check.hint
    return {c.name for c in checks if not c.ok}


def table(**values: Any) -> CalibrationSettings:
    """Return calibration settings with some values changed."""
    return msgspec.structs.replace(CalibrationSettings(), **values)


def believing(camera: Intrinsics) -> CellSettings:
    """Return the cell with another camera in its intrinsics file."""
    return cell_settings(nominal=camera, known=KnownIntrinsics(camera))


@pytest.mark.parametrize("seed", range(12))
def test_a_sound_leg_is_accepted(seed: int) -> None:
    """Noise alone fails no test, and the second picture of a leg at rest agrees."""
    settings, pose = cell_settings(), leg_pose(seed)
    calibration = solved(settings, seen(settings, pose, seed))
    second = second_picture_check(calibration, seen(settings, pose, seed + 100), settings)
    assert failed([*picture_checks(calibration, settings), second]) == set()
    assert failed(cell_checks(calibration, settings)) == set()


def test_the_papers_pose_rests_on_the_table() -> None:
    """The published pose, without scatter, has its lowest point at the table."""
    settings = cell_settings()
    still = msgspec.structs.replace(SimSettings(), scatter_mm=0.0, scatter_deg=0.0)
    pose = drawn_pose(still, np.random.default_rng(0))
    calibration = solved(settings, seen(settings, pose))
    assert abs(lowest_point(calibration, settings)) < 0.3


def test_angles_are_told_with_the_spread_that_turns_of_the_leg_have() -> None:
    """The standard deviations of omega, phi, kappa are those of poses drawn by the covariance."""
    settings = cell_settings()
    calibration = solved(settings, seen(settings, leg_pose()))
    rng = np.random.default_rng(2)
    skewed = rng.normal(size=(3, 3)) * 1e-4
    covariance = calibration.solution.covariance.copy()
    covariance[4:7, 4:7] = skewed @ skewed.T
    solution = replace(calibration.solution, covariance=covariance)
    told = document(replace(calibration, solution=solution), settings)["parameters"]
    sigma = {p["name"]: p["sigma"] for p in told}
    turns = rotation_from_vector(rng.multivariate_normal(np.zeros(3), covariance[4:7, 4:7], 20_000))
    angles = angles_from_rotation(turns @ rotation_from_angles(solution.genes[8:11]))
    for name, spread in zip(("omega", "phi", "kappa"), angles.std(axis=0), strict=True):
        assert np.isclose(sigma[name], spread, rtol=0.03)
    assert [name for name in GENES if sigma[name] is None] == ["f", "s_x", "s_y"]


def test_one_wrong_mark_is_left_out_and_named() -> None:
    """A mark 2 px off among ten is left out: the pose is right, the document says so."""
    settings, pose = cell_settings(), leg_pose()
    calibration = solved(settings, seen(settings, pose, 0, P6=(2.0, 0.0)))
    assert calibration.left_out == ("P6",)
    assert failed(picture_checks(calibration, settings)) == set()
    told = document(calibration, settings)
    assert told["left_out"] == ["P6"]
    assert "P6" in told["warnings"][0]
    assert np.hypot(*told["residuals"]["P6"]) > 1.5
    assert max(np.hypot(*r) for n, r in told["residuals"].items() if n != "P6") < 0.2


def test_several_wrong_marks_are_refused() -> None:
    """Four marks off by a pixel or two have no explanation: the residuals are no noise."""
    settings, pose = cell_settings(), leg_pose()
    moves = {"P2": (1.5, 0.4), "P5": (-1.0, 1.2), "P7": (0.3, -1.8), "P8": (1.1, 1.1)}
    checks = picture_checks(solved(settings, seen(settings, pose, 0, **moves)), settings)
    assert {"noise", "suspects"} <= failed(checks)


@pytest.mark.parametrize(
    "changes",
    [
        {"alpha_u": 652.0 * 1.02, "alpha_v": 655.0 * 1.02},
        {"alpha_u": 652.0 * 0.95, "alpha_v": 655.0 * 0.95},
        {"u0": 346.0 + 10.0},
        {"v0": 279.0 - 10.0},
        {"u0": 346.0 + 20.0, "v0": 279.0 + 20.0, "alpha_u": 665.0},
    ],
)
def test_a_wrong_intrinsics_file_is_refused(changes: Mapping[str, Any]) -> None:
    """The marks contradict a camera that is wrong by some percent or px, and it is named."""
    true, pose = cell_settings(), leg_pose()
    wrong = believing(replace(true.nominal, **changes))
    calibration = solved(wrong, seen(true, pose))
    checks = picture_checks(calibration, wrong)
    assert "camera" in failed(checks)
    assert "legato intrinsics" in next(c.hint for c in checks if c.name == "camera")


def test_a_leg_of_another_size_is_told_by_its_marks() -> None:
    """The same picture from farther off shows larger marks than the model has there."""
    settings, pose = cell_settings(), leg_pose()
    picking = seen(settings, pose)
    for size, wrong in ((1.0, set()), (1.01, {"mark size"}), (0.96, {"mark size"})):
        marks = {n: replace(m, size=size, size_sigma=0.001) for n, m in picking.marks.items()}
        checks = picture_checks(solved(settings, Picking(marks)), settings)
        assert failed(checks) == wrong


def test_marks_of_unknown_size_are_refused_unless_not_asked_for() -> None:
    """Where no mark's outline was measured the leg's size is not known; the test can be off."""
    settings, pose = cell_settings(), leg_pose()
    marks = {n: FoundMark(m.u, m.v, m.sigma) for n, m in seen(settings, pose).marks.items()}
    calibration = solved(settings, Picking(marks))
    assert failed(picture_checks(calibration, settings)) == {"mark size"}
    without = replace(settings, calibration=table(max_mark_size_percent=1000.0))
    assert failed(picture_checks(calibration, without)) == set()


def test_one_badly_cut_mark_does_not_speak_for_the_leg() -> None:
    """A single outline that is off by 10 % leaves the mean where the others put it."""
    marks = {f"P{k}": FoundMark(0.0, 0.0, 0.1, 1.0 + 0.0005 * k, 0.002) for k in range(9)}
    marks["P9"] = FoundMark(0.0, 0.0, 0.1, 1.1, 0.002)
    size, sigma = mark_size(marks)
    assert size == pytest.approx(1.002, abs=0.001)
    assert sigma == pytest.approx(0.002 / 3.0, rel=0.05)


@pytest.mark.parametrize(
    ("shift", "turn_deg"),
    [
        ((0.5, 0.0, 0.0), 0.0),
        ((0.0, 0.5, 0.0), 0.0),
        ((0.0, 0.0, 0.5), 0.0),
        ((0.0, 0.0, 0.0), 0.4),
        ((20.0, 0.0, 0.0), 0.0),
        ((0.0, 0.0, 0.0), 10.0),
    ],
)
def test_a_leg_that_moved_is_refused(shift: tuple[float, ...], turn_deg: float) -> None:
    """Half a mm along any axis, or 0.4 deg about the leg's middle, shows in a second picture."""
    settings, pose = cell_settings(), leg_pose()
    middle = pose[:3, 3] + 97.0 * pose[:3, 0]
    turn = rotation_from_vector([0.0, 0.0, np.radians(turn_deg)])
    after = transform(turn, middle + shift - turn @ middle) @ pose
    calibration = solved(settings, seen(settings, pose))
    check = second_picture_check(calibration, seen(settings, after, 5), settings)
    assert not check.ok
    assert "stands still" in check.hint


def test_a_second_picture_with_few_or_wrong_marks_is_refused() -> None:
    """Four marks test nothing, and marks that do not fit one another are no leg at rest."""
    settings, pose = cell_settings(), leg_pose()
    calibration = solved(settings, seen(settings, pose))
    second = seen(settings, pose, 6)
    few = only(second, ("P1", "P2", "P5", "P8"))
    assert not second_picture_check(calibration, few, settings).ok
    assert not second_picture_check(calibration, Picking({}), settings).ok
    wrong = seen(settings, pose, 6, P2=(0.4, 0.0), P5=(-0.4, 0.0), P8=(0.0, 0.4))
    assert not second_picture_check(calibration, wrong, settings).ok


@pytest.mark.parametrize("height", [-6.0, 35.0])
def test_a_leg_that_cannot_lie_there_is_refused(height: float) -> None:
    """Under the table, or higher over it than allowed: camera, table or leg are not as believed."""
    settings, pose = cell_settings(), leg_pose()
    pose[2, 3] += height
    calibration = solved(settings, seen(settings, pose))
    assert "table" in failed(cell_checks(calibration, settings))
    lax = replace(settings, calibration=table(leg_rests_mm=(-1000.0, 1000.0)))
    assert "table" not in failed(cell_checks(calibration, lax))


def test_coplanar_marks_are_refused_before_anything_is_solved() -> None:
    """The eight marks of one plane give no calibration; the refusal names what to add."""
    settings, pose = cell_settings(), leg_pose()
    picking = only(seen(settings, pose), COPLANAR)
    with pytest.raises(CalibrationError, match="add P"):
        solved(settings, picking)
    advice = advise_marks(picking, settings)
    assert set(advice.add) == {"P1", "P8"}
    assert "one plane" in advice.why


def test_advice_names_the_mark_that_would_tell_most() -> None:
    """Without P1, P8 and P10 the worst station is known less well: the best of them is named."""
    settings, pose = cell_settings(), leg_pose()
    sparse = only(seen(settings, pose), ("P1", "P2", "P3", "P5", "P6", "P7"))
    advice = advise(solved(settings, sparse), settings)
    assert advice.use == tuple(sparse.marks)
    assert set(advice.add) & {"P9", "P10"}
    assert advice.add[0] in advice.why
    whole = advise(solved(settings, seen(settings, pose)), settings)
    assert (len(whole.use), whole.add, whole.why) == (7, (), "")


def test_too_few_marks_are_said_to_be_too_few() -> None:
    """Five marks cannot be tested: all others are wanted."""
    settings, pose = cell_settings(), leg_pose()
    advice = advise_marks(only(seen(settings, pose), ("P1", "P2", "P5", "P6", "P8")), settings)
    assert "too few" in advice.why
    assert set(advice.add) == {"P3", "P4", "P7", "P9", "P10"}


def test_free_intrinsics_keep_the_lens_that_is_known() -> None:
    """With free intrinsics, a lens's distortion from the file is used and not fitted away."""
    lens = replace(cell_settings().nominal, k1=-0.05, k2=0.01)
    known, pose = believing(lens), leg_pose()
    guess = Intrinsics(650.0, 650.0, 383.5, 287.5, k1=lens.k1, k2=lens.k2)
    free = replace(known, known=None, nominal=guess, calibration=table(intrinsics="free"))
    calibration = solved(free, picking_of(known, pose))
    camera = calibration.solution.intrinsics
    assert (camera.k1, camera.k2) == (lens.k1, lens.k2)
    assert camera.alpha_u == pytest.approx(lens.alpha_u, rel=1e-4)
    assert np.abs(calibration.world_from_object - pose)[:3, 3].max() < 0.05
    assert "camera" not in {c.name for c in picture_checks(calibration, free)}
