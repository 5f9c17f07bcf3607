"""An extent holds what it says, and its reach is reached."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dynx.rules.geometry import Extent
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import poses, unit_vectors, vectors

EPS = float(np.finfo(float).eps)
REACH = 3.0
"""Points are drawn within a cube of so many metres about the origin; rounding is of that size."""

ROUNDING = 64.0 * EPS * REACH

extents = st.lists(
    st.tuples(vectors(1.0), st.floats(0.0, 1.0)).map(lambda ball: Extent.of_points([ball[0]], ball[1])),
    min_size=1,
    max_size=5,
).map(Extent.union)


@given(extents, vectors(1.0), unit_vectors(), st.integers(0, 2**32 - 1))
def test_no_point_of_the_balls_is_farther_from_an_axis_than_the_reach(
    extent: Extent, origin: tuple[float, float, float], axis: tuple[float, float, float], seed: int
) -> None:
    direction = np.array(axis)
    reach = extent.reach_from_axis(np.array(origin), direction)
    outward = np.random.default_rng(seed).normal(size=(20, 3))
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    surface = extent.points[:, None] + extent.radii[:, None, None] * outward
    distances = np.linalg.norm(np.cross(surface - np.array(origin), direction), axis=-1)
    assert np.max(distances) <= reach + ROUNDING


@given(extents, vectors(1.0), unit_vectors())
def test_the_reach_is_reached(
    extent: Extent, origin: tuple[float, float, float], axis: tuple[float, float, float]
) -> None:
    direction, start = np.array(axis), np.array(origin)
    across = np.cross(np.cross(direction, extent.points - start), direction)
    lengths = np.linalg.norm(across, axis=1)
    sideways = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    unit = np.where(
        lengths[:, None] > 0.0,
        across / np.where(lengths > 0.0, lengths, 1.0)[:, None],
        sideways / np.linalg.norm(sideways),
    )
    farthest = extent.points + extent.radii[:, None] * unit
    distances = np.linalg.norm(np.cross(farthest - start, direction), axis=1)
    assert abs(float(np.max(distances)) - extent.reach_from_axis(start, direction)) <= ROUNDING


@given(extents, poses(1.0))
def test_distances_do_not_depend_on_the_frame(extent: Extent, T: Floats) -> None:
    moved = extent.transform(T)
    axis = np.array([0.0, 0.6, 0.8])
    here = extent.reach_from_axis(np.zeros(3), axis)
    there = moved.reach_from_axis(T[:3, 3], T[:3, :3] @ axis)
    assert abs(here - there) <= ROUNDING


def test_the_box_of_balls() -> None:
    extent = Extent.union([Extent.of_points([(1, 0, 0)], 0.5), Extent.of_points([(0, 0, -1)])])
    low, high = extent.box()
    assert low.tolist() == [0.0, -0.5, -1.0]
    assert high.tolist() == [1.5, 0.5, 0.5]
    assert Extent.of_points([]).empty
    assert not extent.empty
