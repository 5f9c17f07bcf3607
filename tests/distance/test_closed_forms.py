"""Distances that other methods give: textbook formulas, quadratic programs, separating axes."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from dynx.distance import ConvexShape, Hull, distance, separation
from dynx.model.geometry import Box, Capsule, Cylinder, Mesh, Sphere
from dynx.spatial.scalar import Floats
from dynx.testing.strategies.geometry import poses
from tests.distance.shapes import point_distance, shapes, sizes

boxes = st.builds(lambda *edges: Box(edges), sizes(), sizes(), sizes())
capsules = st.builds(Capsule, sizes(), sizes())


@given(shapes().filter(lambda shape: not isinstance(shape, Hull)), poses(1.0), sizes(), poses(1.0))
def test_balls(shape: ConvexShape, T: Floats, radius: float, T_ball: Floats) -> None:
    found = distance(Sphere(radius), T_ball, shape, T)
    exact = point_distance(shape, T, T_ball[:3, 3]) - radius
    assert found.distance == pytest.approx(exact, abs=1e-12)
    assert found.max_error <= 1e-11


@settings(max_examples=40)
@given(capsules, capsules, poses(1.0))
def test_capsules(a: Capsule, b: Capsule, T: Floats) -> None:
    # Points s and t on both axes: least squares within bounds.
    columns = np.stack([[0.0, 0.0, 0.5 * a.length], -0.5 * b.length * T[:3, 2]], axis=1)
    solution = lsq_linear(columns, T[:3, 3], (-1.0, 1.0), tol=1e-15)
    apart = np.linalg.norm(columns @ solution.x - T[:3, 3])
    assert distance(a, np.eye(4), b, T).distance == pytest.approx(apart - a.radius - b.radius, abs=1e-7)


@settings(max_examples=40)
@given(boxes, boxes, poses(1.0))
def test_boxes_apart(a: Box, b: Box, T: Floats) -> None:
    columns = np.concatenate([np.diag(a.size), -T[:3, :3] * b.size], axis=1) / 2
    solution = lsq_linear(columns, T[:3, 3], (-1.0, 1.0), tol=1e-15, method="bvls")
    apart = np.linalg.norm(columns @ solution.x - T[:3, 3])
    found = distance(a, np.eye(4), b, T)
    if apart > 1e-6 or found.distance > 1e-6:
        assert found.distance == pytest.approx(apart, abs=1e-9)


@settings(max_examples=40)
@given(boxes, boxes, poses(0.4))
def test_boxes_that_overlap(a: Box, b: Box, T: Floats) -> None:
    axes = [*np.eye(3), *T[:3, :3].T]
    axes += [np.cross(u, v) for u, v in product(axes[:3], axes[3:]) if np.linalg.norm(np.cross(u, v)) > 1e-6]
    best = max(separation(a, np.eye(4), b, T, sign * axis) for axis in axes for sign in (1.0, -1.0))
    found = distance(a, np.eye(4), b, T)
    if best < 0.0:
        # Axes of nearly parallel edges are left out above.
        assert found.lower >= best - 1e-12
        assert found.lower == pytest.approx(best, abs=1e-6)
        assert found.max_error <= 1e-12


def test_coaxial_and_crossed_cylinders() -> None:
    T = np.eye(4)
    T[2, 3] = 1.0
    assert distance(Cylinder(0.3, 0.8), T, Cylinder(0.2, 0.6), np.eye(4)).distance == pytest.approx(0.3)
    T[:3, 3] = [1.0, 0.0, 0.0]
    assert distance(Cylinder(0.3, 0.8), T, Cylinder(0.2, 0.6), np.eye(4)).distance == pytest.approx(0.5)
    T[:3, :3] = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    assert distance(Cylinder(0.3, 0.8), T, Cylinder(0.2, 0.6), np.eye(4)).distance == pytest.approx(0.5)
    T[0, 3] = 0.45
    assert distance(Cylinder(0.3, 0.8), T, Cylinder(0.2, 0.6), np.eye(4)).distance == pytest.approx(-0.05)


def test_cylinders_rim_to_rim() -> None:
    """Two discs whose axes cross at a right angle: from the upper rim of one to the lowest point of the
    other's, sqrt(dx^2 + dz^2)."""
    T = np.eye(4)
    T[:3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    T[:3, 3] = [2.0, 0.0, 1.5]
    found = distance(Cylinder(0.5, 0.2), np.eye(4), Cylinder(0.5, 0.2), T)
    assert found.lower == pytest.approx(np.hypot(1.9 - 0.5, 1.0 - 0.1), abs=1e-12)
    assert found.max_error <= 1e-12


def test_a_mesh_is_its_hull(tmp_path: object) -> None:
    corners = list(product((0, 1), repeat=3))
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "v 0.5 0.5 0.5\n"
    text += "".join(f"f {i} {j} 9\n" for i in range(1, 9) for j in range(1, i))
    path = f"{tmp_path}/cube.obj"
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    T = np.eye(4)
    T[:3, 3] = [2.0, 0.5, 0.5]
    assert distance(Mesh(path), np.eye(4), Sphere(0.25), T).distance == pytest.approx(0.75)


@pytest.mark.parametrize(
    ("a", "b", "exact"),
    [
        (Sphere(0.3), Sphere(0.2), -0.5),
        (Capsule(0.3, 1.0), Sphere(0.2), -0.5),
        (Capsule(0.3, 1.0), Capsule(0.2, 0.5), -0.5),
        (Box((1.0, 2.0, 3.0)), Box((0.2, 4.0, 0.2)), -0.6),
        (Cylinder(1.0, 0.5), Box((0.2, 0.2, 0.2)), -0.35),
        (Hull(np.zeros((1, 3))), Hull(np.zeros((1, 3))), 0.0),
        (Hull(np.eye(3)[:2]), Hull(np.array([[0.2, 0.2, 0], [1, 1, 0], [0, 1, 0]])), 0.0),
        (Hull(np.array([[-1.0, 0, 0], [1, 0, 0]])), Sphere(0.5), -0.5),
    ],
)
def test_shapes_at_one_place(a: ConvexShape, b: ConvexShape, exact: float) -> None:
    found = distance(a, np.eye(4), b, np.eye(4))
    assert found.distance == pytest.approx(exact, abs=1e-12)
    assert found.max_error <= 1e-12
    assert np.linalg.norm(found.point_a - found.point_b) == pytest.approx(-exact, abs=1e-12)
