"""Distances of ellipsoids: closed forms, bounds that hold, and what they share with other shapes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from dynx.distance import ConvexShape, distance, separation
from dynx.model.geometry import Capsule, Ellipsoid, Plane, Sphere
from dynx.spatial.scalar import Floats
from dynx.testing.strategies.geometry import poses
from tests.distance.shapes import point_distance, shapes, sizes
from tests.distance.test_certificate import check_certificate

ellipsoids = st.builds(lambda *radii: Ellipsoid(radii), sizes(), sizes(), sizes())


@given(ellipsoids, poses(0.6), sizes(), poses(0.6))
def test_a_ball_is_a_point_with_a_radius(shape: Ellipsoid, T: Floats, radius: float, T_ball: Floats) -> None:
    found = distance(Sphere(radius), T_ball, shape, T)
    exact = point_distance(shape, T, T_ball[:3, 3]) - radius
    assert found.distance == pytest.approx(exact, abs=1e-12)
    assert found.max_error <= 1e-11
    check_certificate(found, Sphere(radius), T_ball, shape, T)


@given(ellipsoids, st.sampled_from([(0.0, 0.0, 0.0), (0.05, 0.0, 0.0), (0.0, 0.05, 0.0), (0.0, 0.0, 0.05)]))
def test_the_depth_of_a_point_on_an_axis(shape: Ellipsoid, point: tuple[float, float, float]) -> None:
    T = np.eye(4)
    T[:3, 3] = point
    found = distance(shape, np.eye(4), Sphere(1e-9), T)
    assert found.distance == pytest.approx(point_distance(shape, np.eye(4), T[:3, 3]) - 1e-9, abs=1e-12)


@given(ellipsoids, poses(1.0))
def test_a_plane_is_as_far_as_the_support(shape: Ellipsoid, T: Floats) -> None:
    found = distance(shape, T, Plane(), np.eye(4))
    lowest = np.linalg.norm(np.array(shape.radii) * T[2, :3])
    assert found.distance == pytest.approx(T[2, 3] - lowest, abs=1e-14)


@settings(max_examples=60)
@given(ellipsoids, shapes() | ellipsoids, poses(1.5))
def test_bounds_hold(a: Ellipsoid, b: ConvexShape, T: Floats) -> None:
    found = distance(a, np.eye(4), b, T)
    assert found.lower <= found.upper + 1e-13
    assert separation(a, np.eye(4), b, T, found.normal) == pytest.approx(found.lower, abs=1e-13)
    if found.lower > 0.0:
        check_certificate(found, a, np.eye(4), b, T)
        assert found.max_error <= 1e-11 * max(found.distance, 0.1)
    else:
        # Ellipsoids of revolution about one axis have the same depth all around (docs/distances.md).
        assert found.max_error <= 1e-3 * max(abs(found.distance), 0.1)


@given(ellipsoids, ellipsoids, poses(1.0), st.floats(0.2, 5.0))
def test_distances_grow_with_the_shapes(a: Ellipsoid, b: Ellipsoid, T: Floats, factor: float) -> None:
    found = distance(a, np.eye(4), b, T)
    larger = T.copy()
    larger[:3, 3] *= factor
    grown = (Ellipsoid(tuple(factor * x for x in each.radii)) for each in (a, b))  # type: ignore[arg-type]
    first, second = grown
    again = distance(first, np.eye(4), second, larger)
    assert_allclose(
        again.distance, factor * found.distance, atol=factor * (1e-9 + found.max_error) + again.max_error
    )


def test_two_lenses_on_one_axis_and_a_capsule_through_one() -> None:
    T = np.eye(4)
    T[2, 3] = 0.7
    lens = Ellipsoid((0.5, 0.4, 0.2))
    assert distance(lens, np.eye(4), lens, T).distance == pytest.approx(0.3, abs=1e-12)
    T[2, 3] = 0.3
    assert distance(lens, np.eye(4), lens, T).distance == pytest.approx(-0.1, abs=1e-9)
    # Out of the thin side of the lens: across the capsule, by both half widths.
    found = distance(lens, np.eye(4), Capsule(0.1, 4.0), np.eye(4))
    assert found.distance == pytest.approx(-0.5, abs=1e-9)
