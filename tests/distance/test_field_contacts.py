"""Contact points with a height field: flat ground, valleys, ridges, and the distance of any ground."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dynx.distance import ContactPoint, ConvexShape, PlacedSolid, contact_points, support
from dynx.distance.contact_reduction import TIE
from dynx.distance.solids import Solid, distance_of_solids
from dynx.model.geometry import Box, Capsule, Cylinder, HeightField, Plane, Sphere
from dynx.spatial.scalar import Floats
from tests.distance.shapes import KINDS, random_pose, random_shape
from tests.distance.test_contact_points import check_on_surface, pose, size_of

FLAT = HeightField(tuple((0.5,) * 9 for _ in range(7)), (4.0, 3.0))
ROOF = HeightField(((0.0, 0.5, 0.0),) * 3, (2.0, 2.0))
VALLEY = HeightField(((0.5, 0.0, 0.5),) * 3, (2.0, 2.0))


def touching(
    shape: ConvexShape, T: Floats, ground: HeightField | Plane, T_ground: Floats, within: float = 0.02
) -> tuple[ContactPoint, ...]:
    return contact_points(PlacedSolid(shape, T), PlacedSolid(ground, T_ground), within)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("gap", [1e-3, -1e-3])
def test_a_flat_field_is_a_plane(kind: str, gap: float) -> None:
    rng = np.random.default_rng(1)
    T_ground = random_pose(rng, 1.0)
    T_plane = T_ground @ pose((0.0, 0.0, 0.5))
    for _ in range(5):
        shape, T = random_shape(rng, kind), pose(tuple(rng.uniform(-0.4, 0.4, 3)))
        T[:3, :3] = random_pose(rng, 1.0)[:3, :3]
        lowest = -support(shape, T, (0.0, 0.0, -1.0))[0]
        T[2, 3] += 0.5 + gap - lowest
        on_field, on_plane = (
            touching(shape, T_ground @ T, each, where)
            for each, where in ((FLAT, T_ground), (Plane(), T_plane))
        )
        tolerance = 1e-12 + 2.0 * TIE * size_of(shape)
        least = min(each.gap for each in on_field)
        assert least == pytest.approx(gap, abs=tolerance)
        assert least == pytest.approx(min(each.gap for each in on_plane), abs=tolerance)
        for each in on_field:
            assert_allclose(each.normal, T_plane[:3, 2], atol=1e-12)
            check_on_surface(shape, T_ground @ T, np.array(each.point_a), size_of(shape))


def test_a_box_on_a_flat_field_rests_on_its_corners() -> None:
    box = Box((1.3, 0.9, 0.2))
    for angle in (0.0, 0.3):
        T = pose((0.1, 0.05, 0.6), angle)
        points = touching(box, T, FLAT, np.eye(4))
        corners = [T[:2, :2] @ (0.65 * x, 0.45 * y) + T[:2, 3] for x in (-1, 1) for y in (-1, 1)]
        got = sorted(tuple(np.round(each.point_a[:2], 9)) for each in points)
        assert_allclose(got, sorted(tuple(np.round(c, 9)) for c in corners), atol=1e-9)


def test_a_ball_that_slides_meets_no_inner_edge() -> None:
    for x in np.linspace(-0.7, 0.7, 57):
        points = touching(Sphere(0.2), pose((x, 0.3 * x, 0.699)), FLAT, np.eye(4))
        assert len(points) == 1
        assert_allclose(points[0].normal, (0.0, 0.0, 1.0), atol=1e-12)


@pytest.mark.parametrize("shape", [Sphere(0.2), Cylinder(0.2, 0.4), Capsule(0.2, 0.3)])
def test_a_round_shape_in_a_valley_touches_both_slopes(shape: ConvexShape) -> None:
    T = pose((0.0, 0.1, 0.2 * np.sqrt(1.25) - 1e-4), 0.0, np.pi / 2)
    points = touching(shape, T, VALLEY, np.eye(4), 1e-3)
    normals = sorted({tuple(np.round(each.normal, 6) + 0.0) for each in points})
    x, z = 1.0 / np.sqrt(5.0), 2.0 / np.sqrt(5.0)
    assert_allclose(normals, [(-x, 0.0, z), (x, 0.0, z)], atol=1e-6)
    for each in points:
        assert each.gap == pytest.approx(-1e-4 / np.sqrt(1.25), abs=1e-9)
    assert len({each.feature for each in points}) == len(points)


@pytest.mark.parametrize("gap", [1e-3, -1e-3])
def test_a_box_on_a_ridge_touches_along_it(gap: float) -> None:
    points = touching(Box((0.6, 0.4, 0.2)), pose((0.1, 0.2, 0.6 + gap)), ROOF, np.eye(4))
    assert_allclose(
        sorted(each.point_a for each in points), [(0.0, 0.0, 0.5 + gap), (0.0, 0.4, 0.5 + gap)], atol=1e-7
    )
    for each in points:
        assert_allclose(each.normal, (0.0, 0.0, 1.0), atol=1e-9)
        assert each.gap == pytest.approx(gap, abs=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_the_least_gap_above_any_ground_is_the_distance(kind: str) -> None:
    rng = np.random.default_rng(7)
    ground = HeightField(tuple(map(tuple, rng.uniform(0.0, 0.2, (12, 10)).tolist())), (4.0, 4.4))
    T_ground = random_pose(rng, 1.0)
    solid = Solid(ground, np.eye(4))
    for _ in range(6):
        shape, T = random_shape(rng, kind, -1.0, -0.3), random_pose(rng, 0.0)
        T[:3, 3] = *rng.uniform(-0.5, 0.5, 2), 1.5
        T = T_ground @ T
        body = Solid(shape, np.eye(4))
        # Down to a small distance; the way is at least as long as the distance.
        apart = np.inf
        while apart > 2e-3:
            found = distance_of_solids(body, T, solid, T_ground, np.inf)
            assert found is not None
            apart = found.distance
            T[:3, 3] -= (apart > 2e-3) * (apart - 1e-3) * T_ground[:3, 2]
        points = contact_points(PlacedSolid(shape, T), PlacedSolid(ground, T_ground), 0.02)
        least = min(each.gap for each in points)
        assert least == pytest.approx(apart, abs=1e-9)
        for each in points:
            assert each.gap == pytest.approx(
                np.dot(np.subtract(each.point_a, each.point_b), each.normal), abs=1e-12
            )
            check_on_surface(shape, T, np.array(each.point_a), size_of(shape))
        # A little deeper: the same points, all of them below.
        T[:3, 3] -= 3e-3 * T_ground[:3, 2]
        deeper = contact_points(PlacedSolid(shape, T), PlacedSolid(ground, T_ground), 0.02)
        assert -5e-3 < min(each.gap for each in deeper) < 0.0
