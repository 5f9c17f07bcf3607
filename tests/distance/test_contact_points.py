"""Contact points of two shapes: closed forms, and what holds for every pair of shapes at every pose."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from dynx.distance import ContactPoint, ConvexShape, Hull, PlacedSolid, contact_points, distance, support
from dynx.distance.contact_manifold import MARGIN
from dynx.distance.contact_reduction import SAME_PLACE, TIE
from dynx.distance.cores import core_of
from dynx.distance.support_features import FACE_ANGLE
from dynx.errors import ArgumentError
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, Plane, Shape, Sphere
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat
from dynx.testing.strategies.geometry import poses
from tests.distance.shapes import KINDS, point_distance, random_pose, random_shape, shapes

HERE = np.eye(4)
CUBE, BIG = Box((1.0, 1.0, 1.0)), Box((4.0, 4.0, 1.0))
CORNERS = Hull(np.array(list(itertools.product((-0.5, 0.5), repeat=3))))
ROUNDING = 1e-13


def pose(p: tuple[float, float, float], about_z: float = 0.0, about_x: float = 0.0) -> Floats:
    """Return a pose turned about x first, then about z."""
    z, x = (rotation_from_quat(_quat(angle, k)) for angle, k in ((about_z, 2), (about_x, 0)))
    return homogeneous(z @ x, np.array(p))


def _quat(angle: float, axis: int) -> Floats:
    quat = np.zeros(4)
    quat[axis], quat[3] = np.sin(0.5 * angle), np.cos(0.5 * angle)
    return quat


def points_of(
    a: Shape | Hull, T_a: Floats, b: Shape | Hull, T_b: Floats = HERE, within: float = 0.01, limit: int = 4
) -> tuple[ContactPoint, ...]:
    return contact_points(PlacedSolid(a, T_a), PlacedSolid(b, T_b), within, limit)


def places(points: tuple[ContactPoint, ...]) -> list[tuple[float, ...]]:
    """Return the points of a, sorted."""
    return sorted(tuple(np.round(each.point_a, 9) + 0.0) for each in points)


def size_of(*shapes: ConvexShape) -> float:
    cores = [core_of(each) for each in shapes]
    return sum(core.extent + core.radius for core in cores)


# -- closed forms --


def test_spares_are_the_points_beyond_the_limit() -> None:
    rim = PlacedSolid(Cylinder(0.2, 0.1), pose((0, 0, 0.05)))
    found = contact_points(rim, PlacedSolid(Plane()), 1e-3, spares=True)
    assert found[:4] == contact_points(rim, PlacedSolid(Plane()), 1e-3)
    assert [each.spare for each in found] == [False] * 4 + [True] * 12
    angles = np.sort([np.arctan2(each.point_a[1], each.point_a[0]) for each in found])
    assert np.diff(angles) == pytest.approx(np.pi / 8)
    assert len({each.feature for each in found}) == 16


@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-9, -1e-9, 1e-4])
@pytest.mark.parametrize("shape", [CUBE, CORNERS])
@pytest.mark.parametrize("ground", [Plane(), BIG, Hull(CORNERS.points * [4.0, 4.0, 1.0])])
def test_a_box_rests_on_its_four_corners(shape: Shape | Hull, ground: Shape | Hull, tilt: float) -> None:
    top = 0.0 if isinstance(ground, Plane) else 0.5
    points = points_of(shape, pose((0.0, 0.0, top + 0.499), 0.0, tilt), ground)
    s = 0.5
    assert len({each.feature for each in points}) == 4
    got = np.array(sorted(tuple(np.round(each.point_a, 3) + 0.0) for each in points))
    corners = [(x, y, top - 0.001) for x in (-s, s) for y in (-s, s)]
    assert_allclose(got, corners, atol=1e-3)
    for each in points:
        assert each.gap == pytest.approx(each.point_a[2] - top, abs=ROUNDING + 1e-3 * abs(tilt))
        assert_allclose(each.normal, (0.0, 0.0, 1.0), atol=1e-12 + abs(tilt))


def test_corners_and_features_stay_when_a_box_tips() -> None:
    features = {
        frozenset(each.feature for each in points_of(CUBE, pose((0.0, 0.0, z), 0.3, tilt), ground))
        for tilt in (0.0, 1e-9, -1e-9, 1e-5, -1e-5)
        for z, ground in ((0.999, CUBE), (0.499, Plane()))
    }
    assert len(features) == 2


@pytest.mark.parametrize("gap", [-1e-3, 0.0, 1e-3])
@pytest.mark.parametrize("shapes", [(CUBE, CUBE), (CUBE, CORNERS), (CORNERS, CORNERS)])
def test_a_box_turned_on_a_box_has_four_of_the_octagon(
    shapes: tuple[Shape | Hull, Shape | Hull], gap: float
) -> None:
    points = points_of(shapes[0], pose((0.0, 0.0, 1.0 + gap), np.pi / 4), shapes[1])
    corner = 0.5 * (np.sqrt(2.0) - 1.0)
    octagon = {(x, y) for a in (-0.5, 0.5) for b in (-corner, corner) for x, y in ((a, b), (b, a))}
    got = {tuple(p[:2]) for p in places(points)}
    assert len(got) == 4
    assert got <= {(round(x, 9), round(y, 9)) for x, y in octagon}
    # The largest of its quadrilaterals are the two squares.
    sides = np.diff(np.array([p[:2] for p in by_angle(points)]), axis=0)
    assert_allclose(np.linalg.norm(sides, axis=1), np.hypot(0.5 - corner, 0.5 + corner), atol=1e-9)
    for each in points:
        assert each.gap == pytest.approx(gap, abs=ROUNDING)


def by_angle(points: tuple[ContactPoint, ...]) -> list[tuple[float, ...]]:
    ordered = sorted(places(points), key=lambda p: np.arctan2(p[1], p[0]))
    return [*ordered, ordered[0]]


def test_a_box_over_the_edge_of_a_box() -> None:
    points = points_of(CUBE, pose((0.6, 0.2, 1.0)), CUBE)
    assert places(points) == [(0.1, -0.3, 0.5), (0.1, 0.5, 0.5), (0.5, -0.3, 0.5), (0.5, 0.5, 0.5)]


def test_an_edge_on_a_face_and_two_crossing_edges() -> None:
    low = 0.5 * np.sqrt(2.0)
    points = points_of(CUBE, pose((0.0, 0.0, 0.5 + low), 0.0, np.pi / 4), BIG)
    assert places(points) == [(-0.5, 0.0, 0.5), (0.5, 0.0, 0.5)]
    (crossing,) = points_of(
        CUBE, pose((0.1, 0.2, 2.0 * low), 0.0, np.pi / 4), CUBE, pose((0.0, 0.0, 0.0), np.pi / 2, np.pi / 4)
    )
    assert_allclose(crossing.point_a, (0.0, 0.2, low), atol=1e-12)
    assert crossing.gap == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("ground", [Plane(), BIG, Hull(CORNERS.points * [4.0, 4.0, 1.0])])
def test_a_capsule_lies_on_its_ends(ground: Shape | Hull) -> None:
    top = 0.0 if isinstance(ground, Plane) else 0.5
    points = points_of(Capsule(0.1, 1.0), pose((0.1, 0.0, top + 0.1), 0.0, np.pi / 2), ground)
    assert_allclose(places(points), [(0.1, -0.5, top), (0.1, 0.5, top)], atol=1e-9)


def test_a_capsule_longer_than_the_box_below() -> None:
    points = points_of(Capsule(0.1, 3.0), pose((0.1, 0.0, 0.6), 0.0, np.pi / 2), CUBE)
    assert_allclose(places(points), [(0.1, -0.5, 0.5), (0.1, 0.5, 0.5)], atol=1e-9)


@pytest.mark.parametrize("ground", [Plane(), BIG, Hull(CORNERS.points * [4.0, 4.0, 1.0])])
@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-6, -1e-3])
def test_a_cylinder_stands_on_four_points_of_its_rim(ground: Shape | Hull, tilt: float) -> None:
    """A square in the rim, whose sides are inside it by 1 - cos(pi / 4) = 29 % of the radius, as long as the
    lowest point of the rim is not one of the four."""
    top = 0.0 if isinstance(ground, Plane) else 0.5
    lowest = 0.5 * np.cos(tilt) + 0.3 * abs(np.sin(tilt))
    points = points_of(Cylinder(0.3, 1.0), pose((0.0, 0.0, top + lowest - 1e-4), 0.7, tilt), ground)
    assert len(points) == 4
    assert min(each.gap for each in points) == pytest.approx(-1e-4, abs=2.0 * TIE)
    assert_allclose([np.hypot(p[0], p[1]) for p in places(points)], 0.3, atol=1e-3)
    inner = min(_support_distance(points))
    assert inner >= 0.3 * np.cos(np.pi / 4) - 1e-2


def _support_distance(points: tuple[ContactPoint, ...]) -> list[float]:
    """Return the distances of the sides of the polygon of contact from the axis."""
    corners = np.array([p[:2] for p in by_angle(points)])
    sides = np.diff(corners, axis=0)
    across = corners[:-1, 0] * sides[:, 1] - corners[:-1, 1] * sides[:, 0]
    return [float(x) for x in np.abs(across) / np.linalg.norm(sides, axis=1)]


@pytest.mark.parametrize("ground", [Plane(), BIG])
def test_a_cylinder_lies_on_the_two_ends_of_a_line(ground: Shape) -> None:
    top = 0.0 if isinstance(ground, Plane) else 0.5
    points = points_of(Cylinder(0.3, 1.0), pose((0.0, 0.0, top + 0.3), 0.0, np.pi / 2 + 1e-7), ground)
    assert_allclose(places(points), [(0.0, -0.5, top), (0.0, 0.5, top)], atol=1e-6)


def test_parallel_cylinders_and_capsules_touch_along_a_line() -> None:
    for a, b in ((Cylinder, Cylinder), (Capsule, Capsule), (Cylinder, Capsule)):
        points = points_of(a(0.3, 1.0), pose((0.0, 0.0, 0.0)), b(0.2, 1.5), pose((0.5, 0.0, 0.4)))
        assert_allclose(places(points), [(0.3, 0.0, -0.35), (0.3, 0.0, 0.5)], atol=1e-9)


def test_crossed_capsules_touch_at_one_point() -> None:
    (point,) = points_of(
        Capsule(0.1, 1.0), pose((0.2, 0.1, 0.2), 0.0, np.pi / 2), Capsule(0.1, 1.0), _along_x()
    )
    assert_allclose(point.point_a, (0.2, 0.0, 0.1), atol=1e-12)


def _along_x() -> Floats:
    return pose((0.0, 0.0, 0.0), np.pi / 2, np.pi / 2)


def test_balls() -> None:
    (point,) = points_of(Sphere(0.2), pose((0.3, 0.0, 0.0)), Sphere(0.11))
    assert_allclose(point.point_a, (0.1, 0.0, 0.0), atol=1e-15)
    assert_allclose(point.point_b, (0.11, 0.0, 0.0), atol=1e-15)
    assert point.gap == pytest.approx(-0.01)
    assert points_of(Sphere(0.2), pose((0.33, 0.0, 0.0)), Sphere(0.11)) == ()


def test_two_grounds_and_a_limit_below_one_are_refused() -> None:
    with pytest.raises(ArgumentError, match="grounds"):
        points_of(Plane(), HERE, Plane())
    with pytest.raises(ArgumentError, match="limit is 0"):
        points_of(CUBE, HERE, Plane(), limit=0)


# -- what holds for every pair --


@st.composite
def near_pairs(draw: st.DrawFn) -> tuple[ConvexShape, Floats, ConvexShape, Floats]:
    """Draw two shapes whose distance is small: apart, touching, or overlapping."""
    a, b = draw(shapes() | ellipsoids()), draw(shapes() | ellipsoids())
    T = draw(poses(1.5))
    apart = draw(st.sampled_from([1e-2, 1e-4, 1e-9, 0.0, -1e-6, -1e-3, -1e-2]))
    start = distance(a, HERE, b, T)
    moved = T.copy()
    moved[:3, 3] -= (apart - start.distance) * start.normal
    return a, HERE, b, moved


def ellipsoids() -> st.SearchStrategy[Ellipsoid]:
    size = st.floats(0.1, 1.0)
    return st.builds(lambda *radii: Ellipsoid(radii), size, size, size)


@settings(max_examples=120)
@given(near_pairs(), st.integers(1, 5))
def test_the_least_gap_is_the_distance(
    pair: tuple[ConvexShape, Floats, ConvexShape, Floats], limit: int
) -> None:
    a, T_a, b, T_b = pair
    exact = distance(a, T_a, b, T_b)
    points = points_of(a, T_a, b, T_b, 0.02, limit)
    assert 1 <= len(points) <= limit
    size = size_of(a, b)
    least = min(each.gap for each in points)
    tolerance = (MARGIN + TIE) * size
    assert exact.lower - tolerance <= least <= exact.upper + tolerance
    for each in points:
        assert each.gap <= 0.02
        assert np.linalg.norm(each.normal) == pytest.approx(1.0, abs=ROUNDING)
        between = np.subtract(each.point_a, each.point_b)
        assert each.gap == pytest.approx(between @ each.normal, abs=ROUNDING)
        check_on_surface(a, T_a, np.array(each.point_a), size)
        check_on_surface(b, T_b, np.array(each.point_b), size)
    assert len({each.feature for each in points}) == len(points)


def check_on_surface(shape: ConvexShape, T: Floats, point: Floats, size: float) -> None:
    """Check that a point is on a surface, up to the margin by which it may be beside a face."""
    tolerance = 2.0 * MARGIN * size
    if not isinstance(shape, Hull):
        assert isinstance(shape, Sphere | Box | Cylinder | Capsule | Ellipsoid)
        assert abs(point_distance(shape, T, point)) <= tolerance
        return
    assert abs(distance(Sphere(1e-9), homogeneous(np.eye(3), point), shape, T).distance) <= tolerance + 1e-9


@settings(max_examples=60)
@given(near_pairs())
def test_spares_follow_the_chosen_points_of_any_two_shapes(
    pair: tuple[ConvexShape, Floats, ConvexShape, Floats],
) -> None:
    a, T_a, b, T_b = pair
    chosen = points_of(a, T_a, b, T_b, 0.02)
    found = contact_points(PlacedSolid(a, T_a), PlacedSolid(b, T_b), 0.02, spares=True)
    assert found[: len(chosen)] == chosen
    assert all(each.spare and each.gap <= 0.02 for each in found[len(chosen) :])
    assert len(chosen) == 4 or len(found) == len(chosen)


@given(near_pairs(), poses(3.0))
def test_exchanged_shapes_and_a_rigid_motion(
    pair: tuple[ConvexShape, Floats, ConvexShape, Floats], T_world: Floats
) -> None:
    a, T_a, b, T_b = pair
    here = points_of(a, T_a, b, T_b, 0.02, 64)
    back = points_of(b, T_b, a, T_a, 0.02, 64)
    assert tuple(each.swapped() for each in back) == here
    there = points_of(a, T_world @ T_a, b, T_world @ T_b, 0.02, 64)
    exact = distance(a, T_a, b, T_b)
    least, least_there = (min(point.gap for point in points) for points in (here, there))
    assert least_there == pytest.approx(least, abs=1e-6 + exact.max_error)
    # The direction between shapes that overlap may be one of several.
    if exact.lower > 1e-6:
        assert_allclose(there[0].normal, T_world[:3, :3] @ here[0].normal, atol=1e-5)


@settings(max_examples=60)
@given(near_pairs(), st.tuples(*[st.floats(-1.0, 1.0)] * 6))
def test_a_small_motion_moves_points_little(
    pair: tuple[ConvexShape, Floats, ConvexShape, Floats], direction: tuple[float, ...]
) -> None:
    a, T_a, b, T_b = pair
    exact = distance(a, T_a, b, T_b)
    step = 1e-9
    moved = T_a.copy()
    moved[:3, 3] += step * np.array(direction[:3])
    quat = np.array([*(0.5 * step * x for x in direction[3:]), 1.0])
    moved[:3, :3] = rotation_from_quat(quat / np.linalg.norm(quat)) @ moved[:3, :3]
    before = {each.feature: each for each in points_of(a, T_a, b, T_b, 0.02)}
    after = {each.feature: each for each in points_of(a, moved, b, T_b, 0.02)}
    least = min(each.gap for each in before.values()), min(each.gap for each in after.values())
    size = size_of(a, b)
    assert least[1] == pytest.approx(least[0], abs=4.0 * step * size + 4.0 * TIE * size + exact.max_error)
    if exact.lower < 1e-5:
        return
    # The normal turns by the motion over the distance; points move by that times their size, and crossings
    # of nearly parallel edges by more.
    for feature in before.keys() & after.keys():
        apart = np.subtract(before[feature].point_a, after[feature].point_a)
        assert np.linalg.norm(apart) <= 1e3 * step * size / exact.lower + SAME_PLACE * size


@pytest.mark.parametrize("kind", KINDS)
def test_planes(kind: str) -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        shape, T, T_plane = random_shape(rng, kind), random_pose(rng, 1.0), random_pose(rng, 1.0)
        start = distance(shape, T, Plane(), T_plane)
        T[:3, 3] += (rng.choice([-0.01, 0.0, 0.01]) - start.distance) * start.normal
        points = points_of(shape, T, Plane(), T_plane, 0.05)
        exact = distance(shape, T, Plane(), T_plane).distance
        size = size_of(shape)
        assert min(each.gap for each in points) == pytest.approx(exact, abs=2.0 * TIE * size)
        for each in points:
            assert_allclose(each.normal, T_plane[:3, 2], atol=ROUNDING)
            assert T_plane[:3, 2] @ (each.point_b - T_plane[:3, 3]) == pytest.approx(0.0, abs=ROUNDING)
            check_on_surface(shape, T, np.array(each.point_a), size)
        back = points_of(Plane(), T_plane, shape, T, 0.05)
        assert tuple(each.swapped() for each in back) == points


@pytest.mark.parametrize("shape", [Cylinder(0.5, 0.6), CUBE, CORNERS, Capsule(0.3, 1.0)])
def test_no_gap_jumps_as_a_shape_tips_over(shape: ConvexShape) -> None:
    """Between two nearby attitudes the least gap changes by no more than the motion, and the polygon of
    contact at rest is that of the face up to `FACE_ANGLE`."""
    angles = np.linspace(0.0, np.pi, 200)
    for ground in (Plane(), BIG):
        last = None
        for angle in angles:
            T = pose((0.0, 0.0, 0.0), 0.2, angle)
            T[2, 3] = 0.5 * (ground is BIG) + support(shape, T, (0.0, 0.0, -1.0))[0] - 0.01
            points = points_of(shape, T, ground, within=0.5)
            least = min(each.gap for each in points)
            assert last is None or least == pytest.approx(last, abs=1e-8)
            last = least
            if angle < 0.9 * FACE_ANGLE and not isinstance(shape, Capsule):
                assert len(points) >= 3
