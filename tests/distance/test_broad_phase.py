"""Pairs of near boxes: the same as by comparing all with all."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.distance import PlacedSolid, contact_points
from dynx.distance.broad_phase import Boxes, SolidBounds, pairs_within
from dynx.distance.solids import Solid
from dynx.model.geometry import HeightField, Plane
from dynx.spatial.scalar import Floats
from tests.distance.shapes import KINDS, random_pose, random_shape


@given(st.integers(0, 30), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.3]), st.booleans())
def test_pairs_are_those_of_comparing_all(count: int, seed: int, margin: float, some_infinite: bool) -> None:
    rng = np.random.default_rng(seed)
    center, half = rng.normal(size=(count, 3)), rng.uniform(0.0, 0.5, (count, 3))
    boxes = Boxes(center - half, center + half)
    if some_infinite and count:
        boxes.lower[rng.integers(count, size=2)] = -np.inf
        boxes.upper[rng.integers(count), 1] = np.inf
    allowed = rng.random((count, count)) < 0.7
    allowed &= allowed.T
    near = [
        (i, j)
        for i in range(count)
        for j in range(i + 1, count)
        if allowed[i, j]
        and (boxes.lower[i] - boxes.upper[j] <= margin).all()
        and (boxes.lower[j] - boxes.upper[i] <= margin).all()
    ]
    assert pairs_within(boxes, margin, allowed).tolist() == [list(each) for each in near]


def scene(seed: int) -> tuple[list[Solid], Floats]:
    rng = np.random.default_rng(seed)
    shapes = [random_shape(rng, kind) for kind in KINDS for _ in range(4)]
    field = HeightField(((0.0, 0.1, 0.0), (0.0, 0.2, 0.1)), (2.0, 1.0))
    solids = [Solid(each, np.eye(4)) for each in [*shapes, Plane(), Plane(), field]]
    return solids, np.array([random_pose(rng, 1.0) for _ in solids])


@pytest.mark.parametrize("seed", range(3))
def test_no_pair_that_touches_is_missing(seed: int) -> None:
    solids, T = scene(seed)
    pairs = {(i, j) for i, j in SolidBounds(solids).pairs(T, 0.05).tolist()}
    assert len(pairs) < len(solids) * (len(solids) - 1) / 2
    assert all(i < j for i, j in pairs)
    placed = [PlacedSolid(solid, pose) for solid, pose in zip(solids, T, strict=True)]
    for i, a in enumerate(placed):
        for j in range(i + 1, len(placed)):
            grounds = a.solid.core is None and placed[j].solid.core is None
            if not grounds and contact_points(a, placed[j], 0.05):
                assert (i, j) in pairs


def test_half_spaces_are_compared_by_their_normal() -> None:
    box = random_shape(np.random.default_rng(0), "Box")
    solids = [Solid(shape, np.eye(4)) for shape in (Plane(), box, box)]
    T = np.tile(np.eye(4), (3, 1, 1))
    T[1, 2, 3], T[2, :3, 3] = 5.0, (3.0, 0.0, -2.0)
    assert SolidBounds(solids).pairs(T, 0.1).tolist() == [[0, 2]]
