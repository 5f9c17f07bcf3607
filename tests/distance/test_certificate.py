"""The bounds of a distance are bounds, for every pair of shapes and every pose."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from dynx.distance import ConvexShape, Distance, Hull, distance, separation, support
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, Plane, Sphere
from dynx.spatial.scalar import Floats
from dynx.testing.strategies.geometry import poses, unit_vectors
from tests.distance.shapes import KINDS, point_distance, random_pose, random_shape, shapes

ROUNDING = 1e-13
POINTS = 1e-6
"""Difference of the points from the distance along the normal, whose errors are squared in the bounds."""


@given(shapes(), shapes(), poses(1.5))
def test_bounds_are_attained(a: ConvexShape, b: ConvexShape, T: Floats) -> None:
    found = distance(a, np.eye(4), b, T)
    check_certificate(found, a, np.eye(4), b, T)
    relative = 1e-11 if found.lower > 0.0 else 1e-6
    least = 0.0 if found.lower > 0.0 else gap_of_nearly_parallel_axes(a, b, T)
    assert found.max_error <= relative * max(abs(found.distance), 0.1) + least


def gap_of_nearly_parallel_axes(a: ConvexShape, b: ConvexShape, T: Floats) -> float:
    """Return the gap that an angle between the axes of overlapping round shapes may leave; 0 for others.

    Around nearly one axis the depth is nearly the same in all directions, and no polytope has enough facets.
    The bounds are then those of parallel axes, from which the angle moves points of the second shape by at
    most its sine times their distance. From 1e-3 on the depth differs enough for a polytope.
    """
    if not isinstance(a, Cylinder | Capsule) or not isinstance(b, Cylinder | Capsule):
        return 0.0
    sine = float(np.hypot(T[0, 2], T[1, 2]))
    return sine * (0.5 * b.length + b.radius + 0.5 * a.length + a.radius) if sine < 1e-3 else 0.0


def check_certificate(found: Distance, a: ConvexShape, T_a: Floats, b: ConvexShape, T_b: Floats) -> None:
    """Check both bounds from the support functions and the points alone."""
    assert np.linalg.norm(found.normal) == pytest.approx(1.0, abs=ROUNDING)
    assert separation(a, T_a, b, T_b, found.normal) == pytest.approx(found.lower, abs=ROUNDING)
    assert found.upper >= found.lower - ROUNDING
    check_inside(a, T_a, found.point_a)
    check_inside(b, T_b, found.point_b)
    between = found.point_a - found.point_b
    assert_allclose(between, found.distance * found.normal, atol=POINTS + 2.0 * found.max_error)
    if found.upper > 0.0:
        assert np.linalg.norm(between) == pytest.approx(found.upper, abs=ROUNDING)


def check_inside(shape: ConvexShape, T: Floats, point: Floats) -> None:
    """Check that a point is in a shape."""
    if not isinstance(shape, Hull):
        assert isinstance(shape, Sphere | Box | Cylinder | Capsule | Ellipsoid)
        assert point_distance(shape, T, point) <= ROUNDING
        return
    for direction in np.random.default_rng(0).normal(size=(30, 3)):
        n = direction / np.linalg.norm(direction)
        assert n @ point <= support(shape, T, n)[0] + ROUNDING


@settings(max_examples=40)
@given(shapes(), shapes(), poses(0.3), unit_vectors())
def test_no_direction_needs_less_than_the_depth(
    a: ConvexShape, b: ConvexShape, T: Floats, direction: tuple[float, float, float]
) -> None:
    found = distance(a, np.eye(4), b, T)
    assert separation(a, np.eye(4), b, T, direction) <= found.upper + ROUNDING
    moved = np.eye(4)
    moved[:3, 3] = (1e-9 - found.lower) * found.normal
    assert distance(a, moved, b, T).distance == pytest.approx(1e-9, abs=1e-10)


@settings(max_examples=40)
@given(shapes(), shapes(), poses(1.0), poses(3.0))
def test_distances_are_symmetric_and_invariant(
    a: ConvexShape, b: ConvexShape, T: Floats, T_world: Floats
) -> None:
    here = distance(a, np.eye(4), b, T)
    back = distance(b, T, a, np.eye(4))
    there = distance(a, T_world, b, T_world @ T)
    tolerance = 1e-12 + here.max_error
    for other in (back, there):
        assert other.lower == pytest.approx(here.lower, abs=tolerance + other.max_error)
        assert other.upper == pytest.approx(here.upper, abs=tolerance + other.max_error)


@settings(max_examples=40)
@given(shapes(), shapes(), poses(1.0), st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_a_translation_changes_the_distance_by_no_more_than_its_length(
    a: ConvexShape, b: ConvexShape, T: Floats, step: tuple[float, float, float]
) -> None:
    moved = T.copy()
    moved[:3, 3] += step
    before, after = distance(a, np.eye(4), b, T), distance(a, np.eye(4), b, moved)
    assert after.lower - before.upper <= np.linalg.norm(step) + ROUNDING
    assert before.lower - after.upper <= np.linalg.norm(step) + ROUNDING


@settings(max_examples=40)
@given(shapes(), poses(1.0), poses(1.0))
def test_planes_are_half_spaces(shape: ConvexShape, T: Floats, T_plane: Floats) -> None:
    found = distance(shape, T, Plane(), T_plane)
    lowest = -support(shape, T, -T_plane[:3, 2])[0] - T_plane[:3, 2] @ T_plane[:3, 3]
    assert found.lower == found.upper == pytest.approx(lowest, abs=ROUNDING)
    assert_allclose(found.normal, T_plane[:3, 2], atol=ROUNDING)
    assert_allclose(found.point_a - found.point_b, found.lower * found.normal, atol=ROUNDING)
    assert separation(shape, T, Plane(), T_plane, found.normal) == pytest.approx(found.lower, abs=ROUNDING)
    back = distance(Plane(), T_plane, shape, T)
    assert back.lower == found.lower
    assert_allclose(back.normal, -found.normal)


@pytest.mark.parametrize("first", KINDS)
@pytest.mark.parametrize("second", KINDS)
def test_sizes_may_differ_by_a_million(first: str, second: str) -> None:
    rng = np.random.default_rng(3)
    for reach in (1.0, 0.05):
        for _ in range(3):
            a, b = random_shape(rng, first, -6.0, 0.0), random_shape(rng, second, -6.0, 0.0)
            T_a, T_b = random_pose(rng, reach), random_pose(rng, reach)
            found = distance(a, T_a, b, T_b)
            check_certificate(found, a, T_a, b, T_b)
            if found.lower > 0.0:
                assert found.max_error <= 1e-9 * found.upper


@pytest.mark.parametrize("kind", KINDS)
def test_far_from_the_origin_no_digit_of_the_distance_is_lost(kind: str) -> None:
    rng = np.random.default_rng(4)
    a, b = random_shape(rng, kind), random_shape(rng, kind)
    T_a, T_b = np.eye(4), random_pose(rng, 0.0)
    T_b[:3, 3] = [1.0, 2.0, 0.5]
    near = distance(a, T_a, b, T_b)
    far_a, far_b = T_a.copy(), T_b.copy()
    far_a[:3, 3] += 2.0**40
    far_b[:3, 3] += 2.0**40
    far = distance(a, far_a, b, far_b)
    assert (far.lower, far.upper) == (near.lower, near.upper)


@pytest.mark.parametrize("tilt", [0.0, 1e-16, 1e-12, 1e-9, 1e-8, 1e-6, 1e-3])
@pytest.mark.parametrize("a", [Box((1.0, 1.0, 0.2)), Cylinder(0.5, 0.2)])
@pytest.mark.parametrize("b", [Box((0.6, 0.6, 0.4)), Cylinder(0.3, 0.4)])
@pytest.mark.parametrize("height", [0.4, 0.3, 0.2])
def test_nearly_parallel_faces(a: ConvexShape, b: ConvexShape, tilt: float, height: float) -> None:
    T = np.eye(4)
    T[:3, 3] = [0.05, 0.02, height]
    T[1, 1] = T[2, 2] = np.cos(tilt)
    T[2, 1], T[1, 2] = np.sin(tilt), -np.sin(tilt)
    found = distance(b, T, a, np.eye(4))
    check_certificate(found, b, T, a, np.eye(4))
    lowest = height - 0.1 - 0.2 * np.cos(tilt) - 0.3 * np.sin(tilt)
    assert found.lower == pytest.approx(lowest, abs=1e-9 + 0.3 * tilt * (lowest < 0.0))
    assert found.max_error <= 1e-11


@pytest.mark.parametrize("tilt", [1e-15, 1e-12, 1e-9, 1e-6, 1e-5])
@pytest.mark.parametrize("other", [Cylinder(0.2, 0.3), Capsule(0.2, 0.3), Cylinder(0.3, 0.1)])
def test_cylinders_on_nearly_one_axis(other: Cylinder | Capsule, tilt: float) -> None:
    a, T = Cylinder(0.3, 1.5), np.eye(4)
    T[1, 1] = T[2, 2] = -np.cos(tilt)
    T[2, 1], T[1, 2] = np.sin(tilt), -np.sin(tilt)
    T[2, 3] = 0.1
    found = distance(a, np.eye(4), other, T)
    check_certificate(found, a, np.eye(4), other, T)
    assert found.distance == pytest.approx(-0.3 - other.radius, abs=tilt + 1e-12)
    assert found.max_error <= tilt + 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_equal_shapes_at_equal_poses(kind: str) -> None:
    shape = random_shape(np.random.default_rng(5), kind)
    found = distance(shape, np.eye(4), shape, np.eye(4))
    check_certificate(found, shape, np.eye(4), shape, np.eye(4))
    assert found.lower < 0.0
    # The widths of a shape along any direction are at least its depth in itself.
    for direction in np.random.default_rng(6).normal(size=(100, 3)):
        assert -separation(shape, np.eye(4), shape, np.eye(4), direction) >= -found.upper - ROUNDING
    assert found.max_error <= 1e-9


@settings(max_examples=40)
@given(shapes(), shapes(), poses(1.0))
def test_shapes_that_touch(a: ConvexShape, b: ConvexShape, T: Floats) -> None:
    start = distance(a, np.eye(4), b, T)
    moved = np.eye(4)
    moved[:3, 3] = -start.lower * start.normal
    found = distance(a, moved, b, T)
    check_certificate(found, a, moved, b, T)
    assert abs(found.lower) <= 1e-12 + start.max_error
    assert abs(found.upper) <= 1e-12 + start.max_error + found.max_error
