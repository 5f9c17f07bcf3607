"""Poses, attitudes, directions and wrenches: what they promise, what they shrink to."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given

from dynx.agreement.magnitudes import EPS
from dynx.errors import ArgumentError, DTypeError, DynxError, NotFiniteError
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import poses, quaternions, unit_vectors, vectors, wrenches
from tests.testing.occurrence import assert_occurs, simplest

UNIT = 4 * EPS
"""Rounding of a length of 1 that was computed from a handful of products."""


@given(unit_vectors())
def test_directions_have_unit_length(axis: tuple[float, float, float]) -> None:
    assert abs(np.linalg.norm(axis) - 1.0) <= UNIT


@given(quaternions())
def test_quaternions_have_unit_length(quat: Floats) -> None:
    assert quat.shape == (4,)
    assert abs(np.linalg.norm(quat) - 1.0) <= UNIT


@given(poses(reach=2.0))
def test_poses_are_rigid(T: Floats) -> None:
    R = T[:3, :3]
    assert np.max(np.abs(R.T @ R - np.eye(3))) <= 4 * UNIT
    assert np.linalg.det(R) > 0
    assert np.max(np.abs(T[:3, 3])) <= 2.0
    np.testing.assert_array_equal(T[3], [0.0, 0.0, 0.0, 1.0])


@given(wrenches(force=3.0, moment=0.5))
def test_wrenches_are_within_their_bounds(wrench: Floats) -> None:
    assert wrench.shape == (6,)
    assert np.max(np.abs(wrench[:3])) <= 3.0
    assert np.max(np.abs(wrench[3:])) <= 0.5


def test_shrink_targets() -> None:
    assert simplest(unit_vectors(), lambda axis: True) == (0.0, 0.0, 1.0)
    assert simplest(vectors(), lambda vector: True) == (0.0, 0.0, 0.0)
    np.testing.assert_array_equal(simplest(quaternions(), lambda quat: True), [0.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(simplest(poses(), lambda T: True), np.eye(4))
    np.testing.assert_array_equal(simplest(wrenches(), lambda wrench: True), np.zeros(6))


def test_a_failure_shrinks_to_round_numbers() -> None:
    assert simplest(vectors(2.0), lambda vector: vector[1] > 0.5) == (0.0, 1.0, 0.0)


def test_singular_attitudes_occur() -> None:
    assert_occurs(quaternions(), lambda quat: abs(quat[3]) < 1e-9)
    for step in (1e-12, 1e-9, 1e-6, 1e-3):
        assert_occurs(
            quaternions(),
            lambda quat, step=step: 0.45 * step < float(np.linalg.norm(quat[:3])) < 0.55 * step,  # type: ignore[misc]
        )
    assert_occurs(quaternions(), lambda quat: quat[3] < -0.5)


@pytest.mark.parametrize(
    ("value", "error"),
    [
        (0.0, ArgumentError),
        (-1.0, ArgumentError),
        (np.inf, NotFiniteError),
        ("far", DTypeError),
        (True, DTypeError),
    ],
)
def test_reach_that_cannot_be(value: Any, error: type[DynxError]) -> None:
    for strategy, name in ((vectors, "reach"), (poses, "reach"), (wrenches, "force")):
        with pytest.raises(error, match=name):
            strategy(value)
    with pytest.raises(error, match="moment"):
        wrenches(moment=value)
