"""Rigid transforms: inverses, exponentials against mpmath's, logarithms against exponentials."""

from __future__ import annotations

import math

import mpmath
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dynx.spatial.branchless import FLOATS, moved, twist_between
from dynx.spatial.se3 import homogeneous, inverse, pose_error
from dynx.spatial.so3 import rotation_from_quat, skew
from dynx.testing.strategies import poses, quaternions, unit_vectors, vectors
from tests.spatial.rounding import assert_same_to_rounding
from tests.spatial.test_so3 import lengths

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

AT_WORLD = [0.0] * 6 + [1.0]
"""Pose of the frame of the world: from there the exponential leads, and to there the logarithm."""

# Angles [rad], among them those around the switch between closed forms and series.
angles = st.one_of(lengths, st.floats(0.009, 0.011))


@given(poses())
def test_inverse_is_the_matrix_inverse(T_AB: Floats) -> None:
    assert_same_to_rounding(inverse(T_AB) @ T_AB, np.eye(4), 48, size=2.0)
    np.testing.assert_array_equal(inverse(inverse(T_AB))[:3, :3], T_AB[:3, :3])


@given(vectors(), unit_vectors(), angles)
def test_exp_is_the_exponential_of_the_twist(linear: Triple, axis: Triple, angle: float) -> None:
    v, w = np.array(linear), np.array(axis) * angle
    position, quat = np.split(np.array(moved(AT_WORLD, [*v.tolist(), *w.tolist()], FLOATS)), [3])
    with mpmath.workdps(40):
        twist = mpmath.zeros(4)
        for i in range(3):
            twist[i, 3] = mpmath.mpf(float(v[i]))
            for j in range(3):
                twist[i, j] = mpmath.mpf(float(skew(w)[i, j]))
        exact = mpmath.expm(twist) if np.any(v) or np.any(w) else mpmath.eye(4)
        expected = np.array([[float(exact[i, j]) for j in range(4)] for i in range(4)])
    assert_same_to_rounding(homogeneous(rotation_from_quat(quat), position), expected, 64, size=2.0)


@given(vectors(), unit_vectors(), angles.filter(lambda angle: angle < math.pi - 1e-9))
def test_log_undoes_exp(linear: Triple, axis: Triple, angle: float) -> None:
    v, w = np.array(linear), np.array(axis) * angle
    there = moved(AT_WORLD, [*v.tolist(), *w.tolist()], FLOATS)
    linear_back, angular_back = np.split(np.array(twist_between(AT_WORLD, there, FLOATS)), 2)
    assert_same_to_rounding(angular_back, w, 16, size=4.0)
    # The norm of V^-1 is theta / (2 sin(theta / 2)) <= pi / 2, that of V at most 1.
    assert_same_to_rounding(linear_back, v, 128, size=4.0)


@given(poses(), st.sampled_from((1.0, -1.0)))
def test_exp_undoes_log(T_AB: Floats, sign: float) -> None:
    quat = sign * Rotation.from_matrix(T_AB[:3, :3]).as_quat()
    twist = twist_between(AT_WORLD, [*T_AB[:3, 3].tolist(), *quat.tolist()], FLOATS)
    position, quat_back = np.split(np.array(moved(AT_WORLD, twist, FLOATS)), [3])
    assert_same_to_rounding(position, T_AB[:3, 3], 128, size=4.0)
    assert_same_to_rounding(rotation_from_quat(quat_back), T_AB[:3, :3], 96)


@given(poses(), poses())
def test_pose_error_leads_to_the_target(T_world_target: Floats, T_world_frame: Floats) -> None:
    position, rotation = pose_error(T_world_target, T_world_frame)
    np.testing.assert_array_equal(position, T_world_target[:3, 3] - T_world_frame[:3, 3])
    reached = Rotation.from_rotvec(rotation).as_matrix() @ T_world_frame[:3, :3]
    assert_same_to_rounding(reached, T_world_target[:3, :3], 128)


@given(poses())
def test_pose_error_to_itself_is_zero(T_AB: Floats) -> None:
    position, rotation = pose_error(T_AB, T_AB)
    np.testing.assert_array_equal(position, np.zeros(3))
    assert_same_to_rounding(rotation, np.zeros(3), 16)


@given(quaternions(), vectors())
def test_leading_axes_are_batches(quat: Floats, point: Triple) -> None:
    batch = homogeneous(rotation_from_quat(np.stack([quat, quat])), np.array(point))
    assert batch.shape == (2, 4, 4)
    np.testing.assert_array_equal(batch[0], batch[1])
    np.testing.assert_array_equal(batch[0, 3], [0.0, 0.0, 0.0, 1.0])
    single = homogeneous(rotation_from_quat(quat), np.array(point))
    assert single.tobytes() == batch[0].tobytes()
    assert single.flags.writeable
