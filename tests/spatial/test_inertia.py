"""Rigid-body inertia against its definition: sums over point masses."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from dynx.spatial.inertia import RigidInertia, inertia_about_origin
from dynx.spatial.so3 import rotation_from_quat, skew
from dynx.testing.strategies import poses, quaternions, vectors
from tests.spatial.rounding import assert_same_to_rounding

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

points = st.lists(st.tuples(st.floats(0.0, 2.0), vectors()), min_size=1, max_size=6)


def inertia_of_points(body: list[tuple[float, Triple]], T_AB: Floats) -> RigidInertia:
    """Return the inertia about A of point masses (mass, position) that are given in B."""
    total = RigidInertia(np.zeros(()), np.zeros(3), np.zeros((3, 3)))
    for mass, position in body:
        p = T_AB[:3, :3] @ np.array(position) + T_AB[:3, 3]
        total = total + RigidInertia(np.array(mass), mass * p, -mass * skew(p) @ skew(p))
    return total


@given(points, poses())
def test_transformed_inertia_is_the_sum_over_its_points(
    body: list[tuple[float, Triple]], T_AB: Floats
) -> None:
    found = inertia_of_points(body, np.eye(4)).transform(T_AB[:3, :3], T_AB[:3, 3])
    expected = inertia_of_points(body, T_AB)
    # Six points of at most 2 kg within 2 sqrt(3) m of A.
    size = 6 * 2.0 * 12.0
    assert_same_to_rounding(found.mass, expected.mass, 8, size=size)
    assert_same_to_rounding(found.first_moment, expected.first_moment, 32, size=size)
    assert_same_to_rounding(found.rotational_inertia, expected.rotational_inertia, 64, size=size)


@given(points, vectors(), vectors())
def test_momentum_is_the_sum_over_its_points(
    body: list[tuple[float, Triple]], linear: Triple, angular: Triple
) -> None:
    v, w = np.array(linear), np.array(angular)
    p, L = inertia_of_points(body, np.eye(4)).momentum(v, w)
    each = [(m * (v + np.cross(w, r)), np.array(r)) for m, r in body]
    assert_same_to_rounding(p, sum((q for q, _ in each), np.zeros(3)), 32, size=36.0)
    assert_same_to_rounding(L, sum((np.cross(r, q) for q, r in each), np.zeros(3)), 48, size=72.0)


@given(st.floats(0.0, 5.0), vectors(), quaternions(), vectors(), vectors())
def test_inertia_about_origin_is_steiners_theorem(
    mass: float, center: Triple, quat: Floats, diagonal: Triple, products: Triple
) -> None:
    (a, b, c), (d, e, f) = diagonal, products
    tensor = np.array([[a, d, e], [d, b, f], [e, f, c]])
    R, h = rotation_from_quat(quat), np.array(center)
    inertia = inertia_about_origin(np.array(mass), h, R, tensor)
    steiner = R @ tensor @ R.T + mass * (np.eye(3) * (h @ h) - np.outer(h, h))
    np.testing.assert_array_equal(inertia.first_moment, mass * h)
    assert_same_to_rounding(inertia.rotational_inertia, steiner, 32, size=20.0)
