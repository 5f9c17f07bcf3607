"""Branchless exponentials and logarithms against those with branches, to rounding, at every angle."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial import branchless, manifold, so3
from dynx.spatial.scalar import Array, Floats
from tests.oracles.closed_form import MODELS

ROUNDING = 16 * float(np.finfo(np.float64).eps)
"""Bound on the rounding error of a few operations on numbers of order 1."""

ANGLES = [0.0, 5e-324, 1e-200, 1e-160, 1e-150, 1e-100, 1e-20, 1e-12, 1e-9, 1e-8, 1e-6, 1e-4]
ANGLES += [1e-3, 9.9e-3, 1.01e-2, 0.1, 0.5, 1.0, 2.0, 3.0, 3.14, np.pi - 1e-6, np.pi - 1e-9]
SEEDS = st.integers(0, 2**32 - 1).map(np.random.default_rng)
AT_WORLD = [0.0] * 6 + [1.0]
"""Pose of the frame of the world: from there the exponential leads, and to there the logarithm."""

BODY = load(MODELS / "free_body.urdf", base="floating")


def vectors(rng: np.random.Generator, angle: float) -> Floats:
    axes = rng.standard_normal((8, 3))
    axes[:3] = np.eye(3)
    axes[3:6] = -np.eye(3)
    return np.asarray(angle * axes / np.linalg.norm(axes, axis=1, keepdims=True))


@pytest.mark.parametrize("angle", ANGLES)
@given(SEEDS)
def test_rotations_and_poses(angle: float, rng: np.random.Generator) -> None:
    angular, linear = vectors(rng, angle), rng.uniform(-1.0, 1.0, (8, 3))
    quats = so3.quat_exp(angular)
    np.testing.assert_allclose(branchless.quat_exp(angular), quats, rtol=0.0, atol=ROUNDING)
    for sign in (1.0, -1.0):
        np.testing.assert_allclose(
            branchless.quat_log(sign * quats), so3.quat_log(quats), rtol=ROUNDING, atol=angle * ROUNDING
        )
    R = so3.rotation_from_quat(quats)
    # Near an angle of pi, rounding leaves the sign of the axis undetermined.
    for found, expected in zip(
        branchless.rotation_log(R), so3.quat_log(so3.quat_from_rotation(R)), strict=True
    ):
        error = np.max(np.abs(found - expected))
        assert min(error, np.max(np.abs(found + expected)) if angle > 3.1415 else np.inf) < ROUNDING
    for function, rotation in ((branchless.moved, angular), (branchless.twist_between, quats)):
        of_arrays = function(AT_WORLD, [*linear.T, *rotation.T], branchless.ARRAYS)
        for row, a, b in zip(np.stack(of_arrays, axis=-1), linear, rotation, strict=True):
            of_floats = function(AT_WORLD, [*a.tolist(), *b.tolist()], branchless.FLOATS)
            np.testing.assert_allclose(row, of_floats, rtol=0.0, atol=ROUNDING)


@given(SEEDS)
def test_every_largest_component_and_ties_between_them(rng: np.random.Generator) -> None:
    quats = rng.standard_normal((64, 4))
    quats[:16] = rng.choice([-1.0, 0.0, 1.0], (16, 4))
    quats[np.all(quats == 0.0, axis=1)] = [0.0, 0.0, 0.0, 1.0]
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    R = so3.rotation_from_quat(quats)
    back = so3.rotation_from_quat(so3.quat_exp(branchless.rotation_log(R)))
    np.testing.assert_allclose(back, R, rtol=0.0, atol=2 * ROUNDING)


@given(SEEDS)
def test_configurations(rng: np.random.Generator) -> None:
    model: Model = BODY
    q, v = model.random(rng, 20), rng.uniform(-2.0, 2.0, (20, 6))
    other = np.array([model.integrate(*each) for each in zip(q, v, strict=True)])
    np.testing.assert_allclose(manifold.integrate(q, v, floating=True), other, rtol=0.0, atol=ROUNDING)
    other[::2, 3:7] *= -1.0
    found = manifold.difference(q, other, floating=True)
    # Both configurations are rounded numbers of order 1; the displacement comes from their difference.
    each = [model.difference(*pair) for pair in zip(q, other, strict=True)]
    np.testing.assert_allclose(found, each, rtol=0.0, atol=4 * ROUNDING)
    np.testing.assert_allclose(
        manifold.difference(q, q, floating=True), np.zeros((20, 6)), rtol=0.0, atol=ROUNDING
    )


def test_in_many_digits() -> None:
    def exact(numbers: list[float]) -> Array:
        return np.array([mpmath.mpf(x) for x in numbers], dtype=object)

    with mpmath.workdps(50):
        linear, angular = exact([1.0, 2.0, 3.0]), exact([0.3, -0.4, 1.2])
        quat = branchless.quat_exp(angular)
        assert max(abs(branchless.quat_log(quat) - angular)) < mpmath.mpf(10) ** -48
        there = branchless.moved(AT_WORLD, [*linear, *angular], branchless.ARRAYS)
        back = np.array(branchless.twist_between(AT_WORLD, there, branchless.ARRAYS))
        assert max(abs(back[3:] - angular)) < mpmath.mpf(10) ** -48
        assert max(abs(back[:3] - linear)) < mpmath.mpf(10) ** -47
