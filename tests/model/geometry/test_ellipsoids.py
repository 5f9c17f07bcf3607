"""Ellipsoids: the polyhedron near the surface, rays, boxes and images."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError
from dynx.model.geometry import Ellipsoid, Sphere, solid_properties
from dynx.model.geometry.ray_casting import cast_on_shape
from dynx.model.geometry.shells import shell_properties
from dynx.model.geometry.solids import polyhedron_properties
from dynx.model.geometry.triangulation import BALL_DEVIATION

radii = st.tuples(*[st.floats(0.01, 5.0)] * 3)


@given(radii)
def test_the_polyhedron_is_as_near_as_it_says(half_axes: tuple[float, float, float]) -> None:
    shape = Ellipsoid(half_axes)
    vertices, faces = shape.triangles()
    inner = vertices / half_axes
    a, b, c = (inner[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = np.einsum("ij,ij->i", normals, a)
    assert np.linalg.norm(inner, axis=1).max() <= 1.0 + BALL_DEVIATION
    assert offsets.min() >= 1.0 - BALL_DEVIATION
    # Convex: no vertex is above the plane of a triangle.
    assert (inner @ normals.T <= offsets + 1e-12).all()
    found, exact = polyhedron_properties(vertices, faces), solid_properties(shape)
    assert found.volume == pytest.approx(exact.volume, rel=3.0 * BALL_DEVIATION)


@given(radii, st.integers(0, 1000))
def test_rays_hit_the_surface_along_its_normal(half_axes: tuple[float, float, float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    origins, directions = rng.normal(size=(20, 3)) * half_axes * 2.0, rng.normal(size=(20, 3))
    # The first ten pass through the middle.
    directions[:10] = -origins[:10] + 0.1 * rng.normal(size=(10, 3)) * half_axes
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    distances, normals = cast_on_shape(Ellipsoid(half_axes), np.eye(4), origins, directions)
    hit = np.isfinite(distances)
    assert hit[:10].all()
    inner = (origins[hit] + distances[hit, None] * directions[hit]) / half_axes
    np.testing.assert_allclose(np.linalg.norm(inner, axis=1), 1.0, atol=1e-9)
    gradients = inner / half_axes
    gradients /= np.linalg.norm(gradients, axis=1, keepdims=True)
    np.testing.assert_allclose(normals[hit], gradients, atol=1e-6)


@given(st.floats(0.01, 5.0))
def test_equal_half_axes_are_a_ball(radius: float) -> None:
    ellipsoid, ball = Ellipsoid((radius,) * 3), Sphere(radius)
    for properties in (solid_properties, shell_properties):
        found, exact = properties(ellipsoid), properties(ball)
        # The shell of MuJoCo's has a thickness.
        close = 1e-12 if properties is solid_properties else 3e-6 / radius
        assert found.volume == pytest.approx(exact.volume, rel=1e-12)
        np.testing.assert_allclose(found.inertia, exact.inertia, rtol=close)


@pytest.mark.parametrize(
    "half_axes", [(0.0, 1.0, 1.0), (1.0, 2.0), (1.0, -2.0, 1.0), (1.0, float("nan"), 1.0)]
)
def test_half_axes_are_three_positive_numbers(half_axes: tuple[float, ...]) -> None:
    with pytest.raises((ArgumentError, ValueError), match="radii of an ellipsoid"):
        Ellipsoid(half_axes)  # type: ignore[arg-type]
