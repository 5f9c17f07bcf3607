"""Contact geometry without branches: the same as contact points on floats, in 50 digits and in kernels."""

from __future__ import annotations

import itertools

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

from dynx.distance import PlacedSolid, contact_points
from dynx.errors import ArgumentError
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, HeightField, Mesh, Plane, Shape, Sphere
from dynx.rbd.contact_geometry import (
    SurfaceGap,
    ball_on_ball,
    ball_on_capsule,
    ball_on_plane,
    ball_on_triangles,
    ball_points,
    capsule_on_capsule,
    lowest_of_rim,
    plane_point_count,
    plane_points,
)
from dynx.simd.kernel import Kernel
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats
from tests.distance.shapes import random_pose

FAR = 100.0
SHAPES: list[Shape] = [Sphere(0.3), Capsule(0.2, 0.5), Box((0.3, 0.5, 0.2)), Cylinder(0.2, 0.6)]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_the_least_gap_from_a_plane_is_that_of_the_shape(shape: Shape) -> None:
    rng = np.random.default_rng(0)
    balls = ball_points(shape)
    for _ in range(50):
        T, T_plane = random_pose(rng, 1.0), random_pose(rng, 1.0)
        normal, offset = T_plane[:3, 2], T_plane[:3, 2] @ T_plane[:3, 3]
        centers = balls.centers @ T[:3, :3].T + T[:3, 3]
        if isinstance(shape, Cylinder):
            ends = [T[:3, 3] + s * shape.length / 2 * T[:3, 2] for s in (-1.0, 1.0)]
            centers = np.array([*centers, *(lowest_of_rim(c, T[:3, 2], shape.radius, normal) for c in ends)])
        found = [ball_on_plane(c, balls.radius, normal, offset) for c in centers]
        points = contact_points(PlacedSolid(shape, T), PlacedSolid(Plane(), T_plane), FAR)
        deepest = min(points, key=lambda each: each.gap)
        lowest = min(found, key=lambda each: each.gap)
        assert lowest.gap == pytest.approx(deepest.gap, abs=1e-12)
        assert_allclose(lowest.point_a, deepest.point_a, atol=1e-12)
        assert_allclose(lowest.point_b, deepest.point_b, atol=1e-12)
        assert_allclose(lowest.normal, deepest.normal, atol=1e-12)


def test_corners_are_numbered_as_in_contact_points() -> None:
    box, T = Box((0.3, 0.5, 0.2)), random_pose(np.random.default_rng(1), 1.0)
    corners = ball_points(box).centers @ T[:3, :3].T + T[:3, 3]
    for each in contact_points(PlacedSolid(box, T), PlacedSolid(Plane()), FAR):
        assert_allclose(corners[each.feature[0]], each.point_a, atol=1e-14)


def test_the_rim_of_an_upright_cylinder_has_a_point_on_its_disc() -> None:
    axis = np.array([0.0, 0.0, 1.0])
    point = lowest_of_rim(np.zeros(3), axis, 0.5, axis)
    assert_allclose(point, 0.0, atol=0.5)
    assert point[2] == 0.0


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_points_on_a_plane_are_those_of_worlds(shape: Shape) -> None:
    """Each of the world's points is among them, at the same place and gap, and none is lower."""
    rng = np.random.default_rng(7)
    for _ in range(60):
        T, T_plane = random_pose(rng, 1.0), random_pose(rng, 1.0)
        axes = T_plane[:3, [2, 0, 1]].T
        offset = axes[0] @ T_plane[:3, 3]
        found = plane_points(shape, T[:3, :3], T[:3, 3], axes, offset)
        assert len(found) == plane_point_count(shape)
        points = contact_points(PlacedSolid(shape, T), PlacedSolid(Plane(), T_plane), FAR)
        for each in points:
            gap, point = min(found, key=lambda mine: float(np.linalg.norm(mine[1] - each.point_a)))
            assert_allclose(point, each.point_a, atol=1e-12)
            assert gap == pytest.approx(each.gap, abs=1e-12)
        least = min(each.gap for each in points)
        assert min(gap for gap, _ in found) == pytest.approx(least, abs=1e-12)
        ((gap, point),) = plane_points(shape, T[:3, :3], T[:3, 3], axes, offset, deepest=True)
        assert gap == pytest.approx(least, abs=1e-12)
        assert axes[0] @ point - offset == pytest.approx(gap, abs=1e-12)


def test_a_hull_has_the_lowest_vertex_of_each_quadrant() -> None:
    rng = np.random.default_rng(8)
    hull = Mesh("hull.obj")
    vertices: Floats = rng.standard_normal((20, 3))
    vertices /= 4.0 * np.linalg.norm(vertices, axis=1, keepdims=True)
    object.__setattr__(hull, "hull", (vertices, np.zeros((0, 3), dtype=int)))
    for _ in range(30):
        T, axes = random_pose(rng, 1.0), np.eye(3)[[2, 0, 1]]
        found = plane_points(hull, T[:3, :3], T[:3, 3], axes, 0.0)
        assert len(found) == plane_point_count(hull) == 4
        corners = vertices @ T[:3, :3].T + T[:3, 3]
        for gap, point in found:
            assert gap == pytest.approx(point[2], abs=1e-12)
            assert np.abs(corners - point).max(axis=1).min() < 1e-12
        assert min(gap for gap, _ in found) == pytest.approx(corners[:, 2].min(), abs=1e-12)
        ((gap, _),) = plane_points(hull, T[:3, :3], T[:3, 3], axes, 0.0, deepest=True)
        assert gap == pytest.approx(corners[:, 2].min(), abs=1e-12)


def same(found: SurfaceGap, a: Shape, T_a: Floats, b: Shape, T_b: Floats, tolerance: float = 1e-12) -> None:
    points = contact_points(PlacedSolid(a, T_a), PlacedSolid(b, T_b), FAR, 1)
    assert found.gap == pytest.approx(points[0].gap, abs=tolerance)
    assert_allclose(found.point_a - found.point_b, float(found.gap) * found.normal, atol=1e-12)
    assert_allclose(found.normal, points[0].normal, atol=1e-9)


def test_balls_and_capsules() -> None:
    rng = np.random.default_rng(2)
    ball, a, b = Sphere(0.3), Capsule(0.2, 0.5), Capsule(0.1, 1.5)
    for _ in range(50):
        T_a, T_b = random_pose(rng, 1.0), random_pose(rng, 1.0)
        p, q, x, y = T_a[:3, 3], T_b[:3, 3], T_a[:3, 2], T_b[:3, 2]
        same(ball_on_ball(p, 0.3, q, 0.3), ball, T_a, ball, T_b)
        same(ball_on_capsule(p, 0.3, q, y, 0.75, 0.1), ball, T_a, b, T_b)
        same(capsule_on_capsule(p, x, 0.25, 0.2, q, y, 0.75, 0.1), a, T_a, b, T_b)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-7, 1e-4, np.pi])
def test_nearly_parallel_capsules(angle: float) -> None:
    T = np.eye(4)
    T[:3, 3] = (0.5, 0.1, 0.3)
    T[1, 1] = T[2, 2] = np.cos(angle)
    T[2, 1], T[1, 2] = np.sin(angle), -np.sin(angle)
    z = np.array([0.0, 0.0, 1.0])
    found = capsule_on_capsule(T[:3, 3], T[:3, 2], 0.5, 0.1, np.zeros(3), z, 0.5, 0.1)
    assert found.gap == pytest.approx(np.hypot(0.5, 0.1) - 0.2, abs=0.5 * abs(np.sin(angle)) + 1e-12)


def test_a_ball_on_the_triangles_of_a_cell() -> None:
    rng = np.random.default_rng(3)
    for _ in range(30):
        h = rng.uniform(0.0, 0.3, 4)
        field = HeightField(((h[0], h[1]), (h[2], h[3])), (0.8, 0.6))
        place = rng.uniform(-0.2, 0.2, 2)
        center = np.array([*place, 0.5])
        found = ball_on_triangles(center, 0.02, h, (0.8, 0.6), np.array([-0.4, -0.3]))
        # Down to the ground: the foot of the centre is then below it.
        center[2] -= found.gap / found.normal[2]
        found = ball_on_triangles(center, 0.02, h, (0.8, 0.6), np.array([-0.4, -0.3]))
        assert found.gap == pytest.approx(0.0, abs=1e-12)
        points = contact_points(PlacedSolid(Sphere(0.02), _at(center)), PlacedSolid(field), 1e-3)
        along = [each for each in points if np.allclose(each.normal, found.normal, atol=1e-9)]
        if abs(place[0] / 0.8 - place[1] / 0.6) > 0.1:
            assert along
            assert along[0].gap == pytest.approx(0.0, abs=1e-12)
            assert_allclose(along[0].point_b, found.point_b, atol=1e-12)


def _at(p: Floats) -> Floats:
    T = np.eye(4)
    T[:3, 3] = p
    return T


def test_a_kernel_and_50_digits_agree_with_floats() -> None:
    def gaps(a: Array, b: Array) -> dict[str, Array]:
        """Take centre, axis, half length and radius of two capsules."""
        capsules = capsule_on_capsule(a[:3], a[3:6], a[6], a[7], b[:3], b[3:6], b[6], b[7])
        ground = ball_on_triangles(a[:3], a[7], 0.1 * b[:4], (3.0, 4.0), np.array([-1.5, -2.0]))
        rim = ball_on_plane(lowest_of_rim(a[:3], a[3:6], a[7], b[3:6]), 0.0, b[3:6], b[6])
        found = (capsules, ground, rim)
        return {"gaps": np.array([x for g in found for x in (g.gap, *g.point_a, *g.point_b, *g.normal)])}

    rng = np.random.default_rng(4)
    a, b = rng.normal(size=(2, 100, 8))
    for each in (a, b):
        each[:, 3:6] /= np.linalg.norm(each[:, 3:6], axis=1, keepdims=True)
        each[:, 6:] = np.abs(each[:, 6:])
    compiled = np.empty((len(a), 30))
    Kernel(trace(gaps, {"a": (8,), "b": (8,)}))([a, b], [compiled])
    for k in range(len(a)):
        assert_allclose(compiled[k], gaps(a[k], b[k])["gaps"], rtol=1e-11, atol=1e-11)
    with mpmath.workdps(50):
        exact = gaps(*(np.array([mpmath.mpf(x) for x in each[0].tolist()], dtype=object) for each in (a, b)))
        assert_allclose(gaps(a[0], b[0])["gaps"], exact["gaps"].astype(float), rtol=1e-12, atol=1e-12)


def test_shapes_without_such_points_are_refused_by_name(tmp_path: object) -> None:
    with pytest.raises(ArgumentError, match="a shape is Ellipsoid; wanted a Sphere"):
        ball_points(Ellipsoid((0.1, 0.2, 0.3)))
    directions = np.random.default_rng(5).normal(size=(40, 3))
    text = "".join("v {} {} {}\n".format(*(p / np.linalg.norm(p))) for p in directions)
    text += "".join(f"f {i} {j} {k}\n" for i, j, k in itertools.combinations(range(1, 8), 3))
    text += "".join(f"f 1 {k} {k + 1}\n" for k in range(8, 40))
    path = f"{tmp_path}/round.obj"
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    with pytest.raises(ArgumentError, match="has 40 vertices; at most 32"):
        ball_points(Mesh(path))
