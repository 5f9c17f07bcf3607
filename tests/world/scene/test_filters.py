"""The table of pairs that may collide has what `may_collide` says of each pair."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dynx.testing.strategies import scenes
from dynx.world import Scene


@given(scene=scenes(max_robots=2), data=st.data())
def test_the_table_of_pairs_is_that_of_two_parts(scene: Scene, data: st.DataObject) -> None:
    parts = [f"{robot.name}/{link.name}" for robot in scene.robots for link in robot.model.links]
    parts += [body.name for body in scene.bodies]
    if not parts:
        return
    whole = st.sampled_from([*parts, *(robot.name for robot in scene.robots)])
    ignored = data.draw(st.lists(st.tuples(whole, whole), max_size=4))
    robots = tuple(replace(robot, self_collision=data.draw(st.booleans())) for robot in scene.robots)
    changed = replace(scene, robots=robots, ignored=(*scene.ignored, *ignored))
    found = changed.collision_filter.pairs(parts)
    expected = [[changed.may_collide(a, b) for b in parts] for a in parts]
    np.testing.assert_array_equal(found, expected)
