"""Copies of colliders, by which Drake's own mean of two frictions becomes the geometric mean."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("pydrake")

from dynx.engines.drake.materials import copies_of
from dynx.steppers.layout import Layout
from dynx.steppers.material import Material
from dynx.world import Scene, sphere
from dynx.world.preparation import prepare

materials = st.builds(
    Material,
    friction=st.sampled_from((0.0, 0.1, 0.25, 0.5, 0.9, 1.5)),
    torsional_friction=st.sampled_from((0.0, 0.02)),
    rolling_friction=st.sampled_from((0.0, 0.01, 0.3)),
    restitution=st.sampled_from((0.0, 0.7)),
)


def layout(rows: list[Material], ignored: list[tuple[int, int]]) -> Layout:
    bodies = tuple(sphere(str(k), 0.1, mass=1.0, material=each) for k, each in enumerate(rows))
    pairs = tuple((str(i), str(j)) for i, j in ignored)
    return prepare(
        Scene("s", bodies=bodies, ignored=pairs),
        collisions=True,
        joint_limits=True,
        joint_damping=True,
        joint_friction=True,
        joint_armature=True,
        joint_springs=True,
    )


@given(st.data())
def test_one_pair_of_copies_touches_for_each_pair_of_colliders_and_has_its_friction(
    data: st.DataObject,
) -> None:
    rows = data.draw(st.lists(materials, min_size=2, max_size=5))
    pairs = [(i, j) for j in range(len(rows)) for i in range(j)]
    scene = layout(rows, data.draw(st.lists(st.sampled_from(pairs), unique=True, max_size=len(pairs))))
    copies = copies_of(scene)
    assert np.array_equal(copies.collider[: len(rows)], np.arange(len(rows)))
    assert np.array_equal(copies.touch, copies.touch.T)
    for i, j in pairs:
        of_i, of_j = (np.flatnonzero(copies.collider == k) for k in (i, j))
        touching = [(a, b) for a in of_i for b in of_j if copies.touch[a, b]]
        assert len(touching) == bool(scene.collides[i, j])
        for a, b in touching:
            # Drake takes the harmonic mean of two coefficients of friction.
            first, second = copies.friction[a], copies.friction[b]
            mean = 2.0 * first * second / (first + second) if first + second else 0.0
            assert mean == pytest.approx(np.sqrt(rows[i].friction * rows[j].friction), rel=1e-9)
    if len({each.friction for each in rows}) == 1:
        # Colliders of one friction have it to the last bit, also those that touch nothing.
        assert np.array_equal(copies.friction, [rows[0].friction] * len(rows))
    for k in range(len(rows)):
        same = np.flatnonzero(copies.collider == k)
        assert not copies.touch[np.ix_(same, same)].any()
