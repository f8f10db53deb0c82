"""The leg model: the paper's coordinates, surface, normals, clearance, pasted marks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from legato.geometry.leg import Leg
from legato.geometry.transforms import Array

LEG = Leg()
along = st.floats(0.0, 194.0)
turn = st.floats(-np.pi, np.pi)
anywhere = npst.arrays(float, 3, elements=st.floats(-300.0, 300.0))


@pytest.mark.parametrize("name", LEG.names())
def test_every_mark_lies_on_the_surface(name: str) -> None:
    """The paper's coordinates, P10's y corrected, fit the frustum to 0.2 micrometres times a k."""
    assert abs(float(LEG.clearance(LEG.points((name,)))[0])) < 2e-4


def test_the_misprinted_p10_lies_inside_the_wood() -> None:
    """P10 as printed repeats P7's y and is off the surface by millimetres."""
    assert abs(float(LEG.clearance([157.1039, -21.6727, 0.0]))) > 5.0


def test_the_sides_slope_is_the_papers() -> None:
    """Half-angle 6.1051 deg, and the marks stand at 13, 43, 83 and 158 mm along the side."""
    assert np.degrees(LEG.half_angle) == pytest.approx(6.1051, abs=1e-3)
    places = [LEG.marks[n][0] / np.cos(LEG.half_angle) for n in ("P2", "P3", "P4", "P9")]
    assert places == pytest.approx([13.0, 43.0, 83.0, 158.0], abs=2e-3)


@given(x=along, angle=turn, off=st.floats(0.0, 60.0))
def test_clearance_is_the_distance_along_the_normal(x: float, angle: float, off: float) -> None:
    """A point `off` mm out along the normal of the side is `off` mm away."""
    point = LEG.surface_point(x, angle)
    normal = LEG.surface_normal(angle)
    outside = point + off * normal
    if outside[0] <= 194.0 + off * np.sin(LEG.half_angle):
        assert float(LEG.clearance(outside)) == pytest.approx(off, abs=1e-9)
    assert np.linalg.norm(normal) == pytest.approx(1.0)


@given(a=anywhere, b=anywhere)
def test_clearance_never_changes_faster_than_the_point_moves(a: Array, b: Array) -> None:
    """A signed distance is 1-Lipschitz; collision checks between samples rest on it."""
    apart = abs(float(LEG.clearance(a)) - float(LEG.clearance(b)))
    assert apart <= np.linalg.norm(a - b) + 1e-9


def test_clearance_is_negative_inside_only() -> None:
    """The axis is inside between the faces, outside beyond them."""
    x = np.array([-5.0, 0.0, 97.0, 194.0, 200.0])
    gap = LEG.clearance(np.stack([x, 0 * x, 0 * x], axis=-1))
    assert gap == pytest.approx([5.0, 0.0, gap[2], 0.0, 6.0])
    assert gap[2] < -15.0


@pytest.mark.parametrize("name", LEG.names())
def test_a_pasted_mark_keeps_its_lengths(name: str) -> None:
    """Developed coordinates come back, and lengths on the paper are lengths on the surface."""
    flat = np.random.default_rng(3).uniform(-4.0, 4.0, (50, 2))
    solid = LEG.mark_surface(name, flat)
    assert np.allclose(LEG.mark_coordinates(name, solid), flat, atol=1e-9)
    assert np.abs(LEG.clearance(solid)).max() < 1e-9
    step = 1e-4
    for axis in np.eye(2):
        moved = LEG.mark_surface(name, flat + step * axis)
        assert np.allclose(np.linalg.norm(moved - solid, axis=1), step, rtol=1e-4)


def test_p1_and_p8_alone_are_on_the_face() -> None:
    """Two marks lie on the big face, the others on the side."""
    assert [n for n in LEG.names() if LEG.on_face(n)] == ["P1", "P8"]


def test_angles_run_from_up_toward_the_camera() -> None:
    """P1 is at 0, P2 at 45, P5 at 90 and P8 at 135 deg."""
    found = [np.degrees(LEG.mark_angle(n)) for n in ("P1", "P2", "P5", "P8")]
    assert found == pytest.approx([0.0, 45.0, 90.0, 135.0], abs=1e-6)
