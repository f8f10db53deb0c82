"""Rigid transforms: conventions, inverses, and the refusal of matrices that are none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from legato.geometry.transforms import (
    Array,
    NotARotation,
    angle_between,
    angles_from_rotation,
    apply,
    checked_transform,
    invert,
    look_at,
    nearest_rotation,
    rotation_from_angles,
    rotation_from_vector,
    transform,
)

angles = npst.arrays(float, 3, elements=st.floats(-1.5, 1.5))
places = npst.arrays(float, 3, elements=st.floats(-500.0, 500.0))

# As the paper prints it, in inches: no rotation.
PRINTED = [
    [0.009501, -0.9951, 0.00456, 4.8933],
    [0.99664, 0.00891, -0.1004, -2.521],
    [0.1004, 0.000001, 0.99664, 1.2014],
    [0.0, 0.0, 0.0, 1.0],
]


@given(q=angles)
def test_angles_make_a_rotation_and_come_back(q: Array) -> None:
    """Rx Ry Rz with the corrected r11 is orthonormal, and its angles are found again."""
    r = rotation_from_angles(q)
    assert np.allclose(r.T @ r, np.eye(3), atol=1e-14)
    assert np.isclose(np.linalg.det(r), 1.0)
    assert np.allclose(angles_from_rotation(r), q, atol=1e-12)


def test_the_rotation_is_rx_ry_rz() -> None:
    """Each angle alone turns about its own axis, and they are applied kappa first."""
    single = [rotation_from_vector(v) for v in np.diag([0.3, -0.4, 0.5])]
    assert np.allclose(rotation_from_angles([0.3, -0.4, 0.5]), single[0] @ single[1] @ single[2])


@given(q=angles, t=places, p=places)
def test_the_inverse_carries_points_back(q: Array, t: Array, p: Array) -> None:
    """A point carried there and back is where it was."""
    m = transform(rotation_from_angles(q), t)
    assert np.allclose(apply(invert(m), apply(m, p[None])), p, atol=1e-9)


def test_functions_are_vectorised_over_leading_axes() -> None:
    """A stack of transforms gives what each alone gives."""
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (4, 3))
    stack = transform(rotation_from_angles(q), q)
    points = np.arange(6.0).reshape(2, 3)
    each = [apply(transform(rotation_from_angles(a), a), points) for a in q]
    assert np.allclose(apply(stack, points), each)


def test_the_papers_printed_matrix_is_refused_with_its_figures() -> None:
    """The published world_from_object is told to be no rotation, by determinant and error."""
    with pytest.raises(NotARotation, match="determinant") as refused:
        checked_transform(PRINTED)
    assert refused.value.determinant == pytest.approx(0.9985, abs=2e-4)
    assert refused.value.error == pytest.approx(9.7e-3, abs=3e-4)
    mended = np.array(PRINTED)
    mended[:3, :3] = nearest_rotation(mended[:3, :3])
    assert np.abs(mended - PRINTED).max() == pytest.approx(4.9e-3, abs=3e-4)
    checked_transform(mended)


@pytest.mark.parametrize(
    ("matrix", "word"),
    [
        (np.eye(3), "4x4"),
        (np.diag([1.0, 1.0, np.nan, 1.0]), "finite"),
        (np.diag([1.0, 1.0, 1.0, 2.0]), "last row"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "determinant"),
    ],
)
def test_other_matrices_that_are_no_transform_are_refused(matrix: Array, word: str) -> None:
    """Wrong shape, not finite, wrong last row and a mirror are each named."""
    with pytest.raises(ValueError, match=word):
        checked_transform(matrix)


def test_a_camera_looks_where_it_is_aimed_with_its_picture_upright() -> None:
    """The target lies on the optical axis, x is level, and y points down."""
    world_from_camera = look_at([228.6, -101.6, 50.8], [126.0, -4.0, 36.0])
    checked_transform(world_from_camera)
    target = apply(invert(world_from_camera), np.array([[126.0, -4.0, 36.0]]))[0]
    assert np.allclose(target[:2], 0.0, atol=1e-12)
    assert target[2] > 0.0
    assert world_from_camera[2, 0] == pytest.approx(0.0)
    assert world_from_camera[2, 1] < 0.0


def test_a_camera_that_looks_straight_down_needs_the_full_matrix() -> None:
    """look_at cannot choose where right is when looking down, and says so."""
    with pytest.raises(ValueError, match="full matrix"):
        look_at([0.0, 0.0, 100.0], [0.0, 0.0, 0.0])


@given(v=npst.arrays(float, 3, elements=st.floats(-1.0, 1.0)))
def test_the_angle_between_rotations_is_the_length_of_their_vector(v: Array) -> None:
    """Small angles keep their digits."""
    r = rotation_from_vector(v)
    assert angle_between(np.eye(3), r) == pytest.approx(np.linalg.norm(v), rel=1e-6, abs=1e-14)
