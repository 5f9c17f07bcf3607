"""Volumes, centres, moments and hulls of shapes."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.errors import ArgumentError, DescriptionError
from dynx.model.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HeightField,
    Mesh,
    Plane,
    Shape,
    Sphere,
    solid_properties,
)
from dynx.model.geometry.hulls import convex_hull
from dynx.spatial.scalar import Floats
from tests.model.geometry.mesh_files import stl

size = st.floats(0.05, 3.0)


def moments(shape: Shape, inside: Callable[[Floats], Floats], half: tuple[float, float, float]) -> Floats:
    """Return volume and second moments of a shape by summing over a fine grid of points."""
    n = 80
    axes = [np.linspace(-h, h, n, endpoint=False) + h / n for h in half]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    points = points[inside(points)]
    cell = 8.0 * np.prod(half) / n**3
    squares = cell * points.T @ points
    return np.concatenate([[cell * len(points)], np.diag(np.trace(squares) * np.eye(3) - squares)])


@given(size, size)
@settings(max_examples=5)
def test_moments_of_round_shapes_are_those_of_their_points(radius: float, length: float) -> None:
    def tube(p: Floats) -> Floats:
        return np.asarray((np.hypot(p[:, 0], p[:, 1]) < radius) & (np.abs(p[:, 2]) < length / 2))

    def capsule(p: Floats) -> Floats:
        along = np.clip(p[:, 2], -length / 2, length / 2)
        return np.asarray(np.linalg.norm(p - np.outer(along, [0, 0, 1]), axis=1) < radius)

    def ball(p: Floats) -> Floats:
        return np.asarray(np.linalg.norm(p, axis=1) < radius)

    def ellipsoid(p: Floats) -> Floats:
        return np.asarray(np.linalg.norm(p / [radius, length, 0.3], axis=1) < 1.0)

    ends = (radius, radius, length / 2 + radius)
    cases: list[tuple[Shape, Callable[[Floats], Floats], tuple[float, float, float]]] = [
        (Sphere(radius), ball, (radius,) * 3),
        (Cylinder(radius, length), tube, (radius, radius, length / 2)),
        (Capsule(radius, length), capsule, ends),
        (Ellipsoid((radius, length, 0.3)), ellipsoid, (radius, length, 0.3)),
    ]
    for shape, inside, half in cases:
        found = solid_properties(shape)
        wanted = moments(shape, inside, half)
        assert np.allclose([found.volume, *np.diag(found.inertia)], wanted, rtol=2e-2)
        assert np.count_nonzero(found.inertia - np.diag(np.diag(found.inertia))) == 0


@given(st.tuples(size, size, size), st.integers(0, 1000))
@settings(max_examples=20)
def test_a_box_is_the_hull_of_its_corners_wherever_it_lies(
    edges: tuple[float, float, float], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    R, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    corners = np.array(np.meshgrid(*[(-e / 2, e / 2) for e in edges])).reshape(
        3, -1
    ).T @ R.T + rng.standard_normal(3)
    vertices, faces = convex_hull(corners)
    volume = np.linalg.det(vertices[faces]).sum() / 6.0
    assert volume == pytest.approx(math.prod(edges), rel=1e-9)
    assert len(faces) == 12


def test_a_hull_has_the_moments_of_the_solid(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(stl())
    found = solid_properties(Mesh(str(tmp_path / "a.stl"), (2.0, 1.0, -1.0)))
    # A tetrahedron with edges a, b, c along the axes: its moments by integration.
    a, b, c = 2.0, 2.0, -3.0
    mass = abs(a * b * c) / 6.0
    assert found.volume == pytest.approx(mass)
    assert found.center == pytest.approx([a / 4, b / 4, c / 4])
    square = mass * 3.0 / 80.0 * np.array([a * a, b * b, c * c])
    assert np.diag(found.inertia) == pytest.approx(square.sum() - square)
    assert found.inertia[0, 1] == pytest.approx(mass * a * b / 80.0)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((4, 3)), "on one line"),
        (np.outer(np.arange(5.0), [1, 2, 3]), "on one line"),
    ],
)
def test_points_on_a_line_have_no_hull(points: Floats, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        convex_hull(points)


def test_a_flat_mesh_gets_a_thin_hull(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(stl(1))
    vertices, _ = Mesh(str(tmp_path / "a.stl")).hull
    assert np.ptp(vertices[:, 2]) == pytest.approx(1e-4 * math.sqrt(5.0))
    assert solid_properties(Mesh(str(tmp_path / "a.stl"))).volume > 0.0
    (tmp_path / "b.stl").write_bytes(stl(1)[:84] + bytes(50))
    with pytest.raises(DescriptionError, match="on one line"):
        _ = Mesh(str(tmp_path / "b.stl")).hull


@pytest.mark.parametrize("make", [Box, Sphere, lambda x: Cylinder(x, 1.0), lambda x: Capsule(1.0, x)])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, 1e300, "1", None])
def test_sizes_are_positive_and_finite(make: Callable[[object], Shape], value: object) -> None:
    with pytest.raises(ArgumentError):
        make((1.0, 1.0, value) if make is Box else value)


def test_grounds_have_no_volume() -> None:
    for shape in (Plane(), HeightField(((0.0, 1.0), (0.0, 1.0)), (1.0, 1.0))):
        with pytest.raises(ArgumentError, match="has no volume"):
            solid_properties(shape)


def test_the_surface_of_a_height_field() -> None:
    field = HeightField(((0.0, 0.0, 1.0), (0.0, 2.0, 3.0)), (4.0, 2.0))
    vertices, faces = field.triangles()
    assert vertices[[0, 2, 5]].tolist() == [[-2.0, -1.0, 0.0], [2.0, -1.0, 1.0], [2.0, 1.0, 3.0]]
    corners = vertices[faces]
    assert len(faces) == 4
    assert np.all(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0.0)
    with pytest.raises(ArgumentError, match=r"heights\[0, 1\]"):
        HeightField(((0.0, math.nan), (0.0, 0.0)), (1.0, 1.0))
