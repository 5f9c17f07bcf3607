"""Exponentials and logarithms without a branch are those with branches, to rounding, at every angle."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial import branchless, se3, so3
from dynx.spatial.scalar import Array, Floats
from tests.oracles.closed_form import MODELS

ROUNDING = 16 * float(np.finfo(np.float64).eps)
"""Some operations on numbers of order 1, rounded."""
ANGLES = [0.0, 5e-324, 1e-200, 1e-160, 1e-150, 1e-100, 1e-20, 1e-12, 1e-9, 1e-8, 1e-6, 1e-4]
ANGLES += [1e-3, 9.9e-3, 1.01e-2, 0.1, 0.5, 1.0, 2.0, 3.0, 3.14, np.pi - 1e-6, np.pi - 1e-9]
SEEDS = st.integers(0, 2**32 - 1).map(np.random.default_rng)
BODY = load(MODELS / "free_body.urdf", base="floating")


def vectors(rng: np.random.Generator, angle: float) -> Floats:
    axes = rng.standard_normal((8, 3))
    axes[:3] = np.eye(3)
    axes[3:6] = -np.eye(3)
    return np.asarray(angle * axes / np.linalg.norm(axes, axis=1, keepdims=True))


@pytest.mark.parametrize("angle", ANGLES)
@given(SEEDS)
def test_of_rotations_and_poses(angle: float, rng: np.random.Generator) -> None:
    turns, ways = vectors(rng, angle), rng.uniform(-1.0, 1.0, (8, 3))
    quats = so3.quat_exp(turns)
    np.testing.assert_allclose(branchless.quat_exp(turns), quats, rtol=0.0, atol=ROUNDING)
    for sign in (1.0, -1.0):
        np.testing.assert_allclose(
            branchless.quat_log(sign * quats), so3.quat_log(quats), rtol=ROUNDING, atol=angle * ROUNDING
        )
    R = so3.rotation_from_quat(quats)
    # Of a rotation by nearly half a turn the axis is lost to rounding, up to its sign.
    for found, wanted in zip(
        branchless.rotation_log(R), so3.quat_log(so3.quat_from_rotation(R)), strict=True
    ):
        apart = min(np.max(np.abs(found - wanted)), np.max(np.abs(found + wanted)) if angle > 3.1415 else 9.0)
        assert apart < ROUNDING
    for own, other in ((branchless.se3_exp, se3.se3_exp), (branchless.se3_log, se3.se3_log)):
        last = turns if own is branchless.se3_exp else quats
        for found, wanted in zip(own(ways, last), other(ways, last), strict=True):
            np.testing.assert_allclose(found, wanted, rtol=0.0, atol=ROUNDING)


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
def test_of_configurations(rng: np.random.Generator) -> None:
    model: Model = BODY
    q, v = model.random(rng, 20), rng.uniform(-2.0, 2.0, (20, 6))
    other = model.integrate(q, v)
    np.testing.assert_allclose(branchless.integrate(q, v), other, rtol=0.0, atol=ROUNDING)
    other[::2, 3:7] *= -1.0
    found = branchless.difference(q, other)
    # Both ends of the way are rounded numbers of order 1, and the way is taken from their difference.
    np.testing.assert_allclose(found, model.difference(q, other), rtol=0.0, atol=4 * ROUNDING)
    np.testing.assert_allclose(branchless.difference(q, q), np.zeros((20, 6)), rtol=0.0, atol=ROUNDING)


def test_in_many_digits() -> None:
    def exact(numbers: list[float]) -> Array:
        return np.array([mpmath.mpf(x) for x in numbers], dtype=object)

    with mpmath.workdps(50):
        turn = exact([0.3, -0.4, 1.2])
        quat = branchless.quat_exp(turn)
        assert max(abs(branchless.quat_log(quat) - turn)) < mpmath.mpf(10) ** -48
        way, back = branchless.se3_log(*branchless.se3_exp(exact([1.0, 2.0, 3.0]), turn))
        assert max(abs(back - turn)) < mpmath.mpf(10) ** -48
        assert max(abs(way - exact([1.0, 2.0, 3.0]))) < mpmath.mpf(10) ** -47
