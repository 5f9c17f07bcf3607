"""Public conversions of rotations, against SciPy's, with the stated conventions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

import dynx
from dynx.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError
from dynx.model.elements import Vector
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import quaternions, vectors

CLOSE: dict[str, Any] = {"rtol": 0, "atol": 1e-14}


@given(vectors(3.0))
def test_roll_pitch_yaw_are_scipys_fixed_axes(rpy: Vector) -> None:
    wanted = Rotation.from_euler("xyz", rpy)
    quat = dynx.quat_from_rpy(rpy)
    assert quat[3] >= 0.0
    np.testing.assert_allclose(quat, wanted.as_quat(canonical=True) * np.copysign(1, quat[3]), **CLOSE)
    np.testing.assert_allclose(dynx.rotation_from_rpy(rpy), wanted.as_matrix(), **CLOSE)


@given(quaternions())
def test_every_form_leads_back_to_the_same_rotation(quat: Floats) -> None:
    R = dynx.rotation_from_quat(quat)
    np.testing.assert_allclose(R, Rotation.from_quat(quat).as_matrix(), **CLOSE)
    np.testing.assert_allclose(dynx.rotation_from_rpy(dynx.rpy_from_quat(quat)), R, **CLOSE)
    np.testing.assert_allclose(dynx.rotation_from_rpy(dynx.rpy_from_rotation(R)), R, **CLOSE)
    np.testing.assert_allclose(dynx.rotation_from_quat(dynx.quat_from_rotation(R)), R, **CLOSE)


def test_leading_axes_are_batches_and_a_floating_base_takes_the_result() -> None:
    rpy = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 3, 3))
    quat = dynx.quat_from_rpy(rpy)
    assert quat.shape == (2, 3, 4)
    np.testing.assert_allclose(dynx.rpy_from_quat(quat), rpy, **CLOSE)
    np.testing.assert_allclose(dynx.quat_from_rpy([0.0, 0.0, np.pi / 2])[2:], [np.sqrt(0.5)] * 2, **CLOSE)
    solo = dynx.load("solo12", base="floating")
    q = solo.neutral()
    q[3:7] = dynx.quat_from_rpy([0.1, 0.2, 0.3])
    T = dynx.backend("reference", solo).forward_kinematics(q, solo.root)
    np.testing.assert_allclose(dynx.rpy_from_rotation(T[:3, :3]), [0.1, 0.2, 0.3], **CLOSE)


@pytest.mark.parametrize(
    ("function", "argument", "error", "message"),
    [
        ("quat_from_rpy", 0.3, ShapeError, r"rpy has shape \(\); wanted \(..., 3\)"),
        ("quat_from_rpy", "up", DTypeError, "rpy has dtype"),
        ("rotation_from_rpy", [0, 0, np.nan], NotFiniteError, r"rpy\[2\] is nan"),
        ("rpy_from_quat", [0, 0, 0, 0], ArgumentError, "quat_xyzw is a quaternion .* of length 0; wanted"),
        ("rpy_from_quat", [[1, 0, 0, 0], [2, 0, 0, 0]], ArgumentError, r"quat_xyzw\[1\] is a quaternion"),
        ("rotation_from_quat", [1, 0, 0], ShapeError, r"quat_xyzw has shape \(3,\)"),
        ("rpy_from_rotation", np.eye(4), ShapeError, r"of a pose T, T\[\.\.\., :3, :3\]"),
        ("rpy_from_rotation", [0.1, 0.2, 0.3], ShapeError, r"R has shape \(3,\); wanted \(..., 3, 3\)"),
        ("quat_from_rotation", np.diag([1, 1, -1]), ArgumentError, "R is not a rotation matrix"),
    ],
)
def test_anything_else_is_refused(function: str, argument: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        getattr(dynx, function)(argument)
