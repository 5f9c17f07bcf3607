"""Rotations against SciPy's, against matrix exponentials, and against their own inverses."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dynx.spatial.scalar import Array, jacobi_eigen, longdouble
from dynx.spatial.so3 import (
    cross,
    quat_exp,
    quat_from_rotation,
    quat_log,
    quat_product,
    rotate,
    rotate_back,
    rotation_about,
    rotation_from_quat,
    rotation_from_rpy,
    rpy_from_rotation,
    skew,
)
from dynx.testing.strategies import quaternions, unit_vectors, vectors
from tests.spatial.rounding import assert_same_to_rounding

Floats = NDArray[np.float64]

# Pitch at and near gimbal lock, where roll and yaw rotate about the same axis.
STEPS = (0.0, 1e-17, 1e-16, 1e-15, 1e-12, 1e-10, 9e-10, 1.1e-9, 1e-8, 1e-6, 1e-4, 1e-2)
near_lock = st.builds(
    lambda side, step, direction: side * (math.pi / 2 + direction * step),
    st.sampled_from((1, -1)),
    st.sampled_from(STEPS),
    st.sampled_from((1, -1)),
)
angle = st.floats(-math.pi, math.pi)
rpys = st.tuples(angle, st.one_of(angle, near_lock), angle).map(np.array)

# Norms of a rotation vector up to pi [rad], the smallest floats among them.
lengths = st.one_of(
    st.sampled_from((0.0, 5e-324, 1e-200, 1e-30, 1e-12, 1e-8, 1e-4, 1e-2, 1.0, 3.0)),
    st.sampled_from(STEPS).map(lambda step: math.pi - step),
    st.floats(0.0, math.pi),
)


@given(rpys)
def test_rpy_is_scipys_extrinsic_xyz(rpy: Floats) -> None:
    assert_same_to_rounding(rotation_from_rpy(rpy), Rotation.from_euler("xyz", rpy).as_matrix(), 16)


@given(rpys)
def test_rpy_reproduces_the_rotation(rpy: Floats) -> None:
    R = rotation_from_rpy(rpy)
    assert_same_to_rounding(rotation_from_rpy(rpy_from_rotation(R)), R, 24)


@given(quaternions())
def test_rpy_reproduces_any_orientation(quat: Floats) -> None:
    R = rotation_from_quat(quat)
    assert_same_to_rounding(rotation_from_rpy(rpy_from_rotation(R)), R, 24)


@pytest.mark.parametrize("side", [1, -1])
def test_yaw_is_zero_where_it_is_undetermined(side: int) -> None:
    R = rotation_from_rpy(np.array([0.3, side * math.pi / 2, -0.4]))
    roll, pitch, yaw = rpy_from_rotation(R)
    assert yaw == 0.0
    assert pitch == side * math.pi / 2
    assert_same_to_rounding(roll, 0.3 + side * 0.4, 16)


@given(unit_vectors(), st.floats(-20.0, 20.0))
def test_rotation_about_an_axis_is_scipys(axis: tuple[float, float, float], angle: float) -> None:
    expected = Rotation.from_rotvec(np.array(axis) * angle).as_matrix()
    # SciPy computes the angle as the norm of a vector, which rounds it.
    operations = 16 + 4 * int(abs(angle))
    assert_same_to_rounding(rotation_about(np.array(axis), np.array(angle)), expected, operations)


@given(quaternions())
def test_rotation_of_a_quaternion_is_scipys(quat: Floats) -> None:
    assert_same_to_rounding(rotation_from_quat(quat), Rotation.from_quat(quat).as_matrix(), 16)


@given(quaternions())
def test_quaternion_of_a_rotation_has_its_orientation_and_positive_w(quat: Floats) -> None:
    found = quat_from_rotation(rotation_from_quat(quat))
    assert found[3] >= 0.0
    # q and -q are the same rotation; at an angle of pi, w may round to either side of zero.
    distance = min(np.max(np.abs(found - quat)), np.max(np.abs(found + quat)))
    assert_same_to_rounding(distance, 0.0, 32)


@given(quaternions(), quaternions(), vectors())
def test_product_of_quaternions_is_that_of_rotations(
    a: Floats, b: Floats, x: tuple[float, float, float]
) -> None:
    product = rotation_from_quat(quat_product(a, b))
    assert_same_to_rounding(product, rotation_from_quat(a) @ rotation_from_quat(b), 48)
    in_two_steps = rotate(rotation_from_quat(a), rotate(rotation_from_quat(b), np.array(x)))
    assert_same_to_rounding(rotate(product, np.array(x)), in_two_steps, 64, size=2.0)


@given(unit_vectors(), lengths)
def test_log_undoes_exp(axis: tuple[float, float, float], length: float) -> None:
    vector = np.array(axis) * length
    quat = quat_exp(vector)
    assert_same_to_rounding(np.linalg.norm(quat), 1.0, 8)
    # The error is relative to the norm: small rotations keep all their digits.
    smallest = float(np.finfo(float).tiny)
    found = quat_log(quat)
    if length < math.pi - 1e-9:
        assert_same_to_rounding(found, vector, 16, size=max(length, smallest))
    else:
        # Rounded to slightly more than pi, the rotation is logged about the opposite axis.
        error = min(np.max(np.abs(found - vector)), np.max(np.abs(found + vector)))
        assert_same_to_rounding(error, 0.0, 16, size=2.0 * math.pi)


@given(quaternions())
def test_exp_undoes_log_and_the_angle_is_at_most_pi(quat: Floats) -> None:
    vector = quat_log(quat)
    assert float(np.linalg.norm(vector)) <= math.pi * (1.0 + 4.0 * np.finfo(float).eps)
    back = quat_exp(vector)
    distance = min(np.max(np.abs(back - quat)), np.max(np.abs(back + quat)))
    assert_same_to_rounding(distance, 0.0, 24)


@given(unit_vectors(), lengths)
def test_exp_is_the_exponential_of_the_skew_matrix(axis: tuple[float, float, float], length: float) -> None:
    vector = np.array(axis) * length
    with mpmath.workdps(40):
        exact = mpmath.expm(mpmath.matrix(skew(vector).tolist())) if np.any(vector) else mpmath.eye(3)
        expected = np.array([[float(exact[i, j]) for j in range(3)] for i in range(3)])
    assert_same_to_rounding(rotation_from_quat(quat_exp(vector)), expected, 24)


@given(vectors(), vectors())
def test_cross_skew_and_numpy_agree(a: tuple[float, float, float], b: tuple[float, float, float]) -> None:
    x, y = np.array(a), np.array(b)
    np.testing.assert_array_equal(cross(x, y), np.cross(x, y))
    np.testing.assert_array_equal(skew(x), -skew(x).T)
    assert_same_to_rounding(skew(x) @ y, np.cross(x, y), 4)


@given(quaternions(), vectors())
def test_rotating_back_undoes_rotating(quat: Floats, a: tuple[float, float, float]) -> None:
    R = rotation_from_quat(quat)
    assert_same_to_rounding(rotate_back(R, rotate(R, np.array(a))), np.array(a), 32, size=2.0)


def test_leading_axes_are_batches() -> None:
    rng = np.random.default_rng(1)
    quat = rng.standard_normal((2, 3, 4))
    quat /= np.linalg.norm(quat, axis=-1, keepdims=True)
    R = rotation_from_quat(quat)
    assert R.shape == (2, 3, 3, 3)
    for function, argument in ((quat_from_rotation, R), (rpy_from_rotation, R), (quat_log, quat)):
        stacked = function(argument)
        singly = [[function(argument[i, j]) for j in range(3)] for i in range(2)]
        np.testing.assert_array_equal(stacked, np.array(singly))


def test_rotations_work_on_fifty_digit_numbers() -> None:
    with mpmath.workdps(50):
        rpy = np.array([mpmath.mpf(1) / 3, mpmath.mpf(-2) / 7, mpmath.mpf(5) / 11], dtype=object)
        R = rotation_from_rpy(rpy)
        defect = R @ R.T - np.eye(3, dtype=int)
        assert max(abs(entry) for entry in defect.ravel()) < mpmath.mpf(10) ** -48
        axis = np.array([mpmath.mpf(2) / 3, mpmath.mpf(-1) / 3, mpmath.mpf(2) / 3], dtype=object)
        Q = rotation_about(axis, np.array(mpmath.mpf(1) / 7, dtype=object))
        assert max(abs(entry) for entry in (Q @ axis - axis).ravel()) < mpmath.mpf(10) ** -48


def test_half_a_turn_has_a_logarithm() -> None:
    """The scalar part is exactly zero, by which a formula for small angles would divide."""
    for axis in np.eye(3):
        assert_same_to_rounding(quat_log(np.append(axis, 0.0)), math.pi * axis, 2)


def test_one_rotation_has_the_quaternion_of_a_batch() -> None:
    """Right angles, tiny angles and matrices that are no rotations included, to the last bit."""
    rng = np.random.default_rng(0)
    R = np.concatenate(
        [
            Rotation.random(500, random_state=1).as_matrix(),
            Rotation.from_rotvec(1e-9 * rng.normal(size=(50, 3))).as_matrix(),
            Rotation.from_euler("xyz", 0.5 * np.pi * rng.integers(-2, 3, (100, 3))).as_matrix(),
            rng.normal(size=(100, 3, 3)),
        ]
    )
    single = np.array([quat_from_rotation(each) for each in R])
    assert single.tobytes() == quat_from_rotation(R).tobytes()
    assert np.isnan(quat_from_rotation(np.full((3, 3), np.nan))).all()


EPS = float(np.finfo(np.longdouble).eps)

entries = st.floats(-1.0, 1.0, allow_subnormal=False)


def _size(A: Array) -> float:
    return float(np.max(np.abs(A)))


@given(st.tuples(*[entries] * 6))
def test_eigenvectors_rebuild_the_matrix_and_are_orthonormal(six: tuple[float, ...]) -> None:
    xx, xy, xz, yy, yz, zz = six
    A = longdouble([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    values, vectors = jacobi_eigen(A)
    # Jacobi rounds once per rotation, nine rotations a sweep, some six sweeps.
    bound = 3 * 9 * 6 * EPS
    assert _size(vectors @ np.diag(values) @ vectors.T - A) <= bound * _size(A)
    assert _size(vectors.T @ vectors - np.eye(3)) <= bound
