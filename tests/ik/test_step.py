"""Inverse kinematics along axes in kernels: the error of NumPy, and results that other engines confirm."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dynx.backends import backend
from dynx.ik.options import AxisRequirement, Options
from dynx.ik.problem import checked_problem
from dynx.ik.step import INSIDE, AxisKind, axis_error, axis_values
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_rpy
from tests.oracles.closed_form import MODELS

ARM = load(MODELS / "seven_axis_arm.urdf")
FRAME = ARM.frame_names[-1]

ROUNDING = 1e-9
"""Largest difference of errors [1, m, rad]; near an angle of pi the logarithm magnifies rounding."""

REQUIREMENTS: list[dict[str, Any]] = [
    {"free": "rotation_z"},
    {"free": "rotation_x", "axes": "world"},
    {"free": ("position_x", "rotation"), "axes": "world"},
    {"free": ("rotation_x", "rotation_y")},
    {"free": "rotation_y", "point": [0.0, 0.0, 0.1]},
    {"weights": [1.0, 1.0, 1.0, 0.1, 0.2, 0.3]},
    {"weights": [0.0, 2.0, 1.0, 1.0, 0.0, 0.0], "axes": "world"},
    {"position_tolerance": [0.01, 0.02, 1e-6], "rotation_tolerance": [0.1, 0.1, 1e-6]},
    {"position_tolerance": [0.01, 0.01, 0.01]},
    {"rotation_tolerance": [np.inf, 0.05, 0.05]},
]

BOUNDS = (float(np.sqrt(0.02)), float(np.sqrt(0.05)), float(np.sqrt(2e-6)))
"""Bounds [m, rad] that no error equals to rounding."""

angles = st.one_of(st.floats(-4.0, 4.0), st.sampled_from([0.0, 0.5 * np.pi, np.pi]))
rotations = st.tuples(angles, angles, angles).map(lambda rpy: rotation_from_rpy(np.array(rpy)))
positions = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array)
requirements = st.builds(
    AxisRequirement,
    st.tuples(*[st.sampled_from([0.0, 1.0, 2.5])] * 6).filter(any),
    st.sampled_from([None, BOUNDS]),
    st.sampled_from([None, BOUNDS]),
    st.booleans(),
)


def independent_error(
    axes: AxisRequirement, R: Floats, target: Floats, p: Floats, position: Floats
) -> Floats:
    """Return the error (6,) along the axes, by SciPy's rotation vectors."""
    basis = target if axes.of_target else np.eye(3)
    rotation = Rotation.from_matrix(target @ R.T).as_rotvec()
    if (k := axes.free_rotation) is not None:
        goal = basis[:, k]
        current = R @ (target.T @ goal)
        normal = np.cross(current, goal)
        sine = float(np.linalg.norm(normal))
        rotation = normal * (np.arctan2(sine, current @ goal) / sine if sine > 1e-12 else 1.0)
    error = np.concatenate([basis.T @ (position - p), basis.T @ rotation])
    return np.where(np.array(axes.weights) != 0.0, error, 0.0)


@given(requirements, rotations, rotations, positions, positions)
def test_the_error_and_what_counts_of_it(
    axes: AxisRequirement, R: Floats, target: Floats, p: Floats, position: Floats
) -> None:
    J = np.arange(42.0).reshape(6, 7)
    found, rows = axis_error(AxisKind.of(axes), (R, p, J), position, target, axis_values(axes))
    error = independent_error(axes, R, target, p, position)
    distance, angle = np.linalg.norm(error[:3]), np.linalg.norm(error[3:])
    # At an angle of pi two vectors of opposite directions are right.
    assume(angle < 3.1 and np.linalg.norm(Rotation.from_matrix(target @ R.T).as_rotvec()) < 3.1)
    assert np.array([found.distance, found.angle]) == pytest.approx([distance, angle], abs=ROUNDING)
    bounds = np.array(
        [*(axes.position_tolerances or [np.inf] * 3), *(axes.rotation_tolerances or [np.inf] * 3)]
    )
    assert bool(found.within) == (np.abs(error) <= bounds).all()
    slack = np.where(np.isfinite(bounds), INSIDE * bounds, 0.0)
    excess = np.sign(error) * np.maximum(np.abs(error) - slack, 0.0)
    weights = np.array(axes.weights)
    used = weights != 0.0
    np.testing.assert_allclose(found.vector, (weights * excess)[used], atol=10.0 * ROUNDING)
    # An error within its tolerance restricts nothing.
    silent = (excess == 0.0) & (slack > 0.0)
    assert not np.any(rows[silent[used]])
    assert np.any(rows[~silent[used]], axis=1).all()


def test_opposite_directions_are_turned_by_pi() -> None:
    axes = AxisRequirement((0.0, 0.0, 0.0, 1.0, 1.0, 0.0), None, None, True)
    J = np.zeros((6, 1))
    for half_turn in np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, -1.0]):
        frame = (half_turn, np.zeros(3), J)
        found, _ = axis_error(AxisKind.of(axes), frame, None, np.eye(3), axis_values(axes))
        assert float(found.angle) == pytest.approx(np.pi)
        assert np.linalg.norm(np.array(found.vector, dtype=float)) == pytest.approx(np.pi)


@pytest.mark.long_cases
@pytest.mark.parametrize("options", REQUIREMENTS, ids=str)
def test_targets_are_reached_as_another_engine_confirms(options: dict[str, Any]) -> None:
    rng = np.random.default_rng(3)
    with backend("compiled", ARM, threads=2) as engine, backend("pinocchio", ARM) as other:
        targets = engine.forward_kinematics(ARM.random(rng, 60), FRAME)
        targets[:2, :3, 3] += 10.0
        found = engine.inverse_kinematics(targets, FRAME, max_restarts=30, **options)
        problem = checked_problem(ARM, targets, FRAME, None, Options.of(options))
        errors = [task.error(found.q[k]) for k, task in problem.tasks(other)]
        assert found.success[2:].all()
        assert [error.reached for error in errors] == found.success.tolist()
        for error, distance, angle in zip(errors, found.position_error, found.rotation_error, strict=True):
            assert (error.position, error.rotation) == pytest.approx((distance, angle), abs=ROUNDING)
        assert ((found.q >= ARM.lower) & (found.q <= ARM.upper)).all()
        for k in (0, 7):
            alone = engine.inverse_kinematics(targets[k], FRAME, max_restarts=30, **options)
            np.testing.assert_array_equal(alone.q, found.q[k])
            assert (alone.iterations, alone.status) == (found.iterations[k], found.status[k])
