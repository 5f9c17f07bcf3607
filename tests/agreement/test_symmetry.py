from __future__ import annotations

import numpy as np

from dynx.agreement.symmetry import rotate_world
from tests.agreement.robots import arm


def test_gravity_rotates_and_keeps_its_magnitude() -> None:
    model, _ = rotate_world(arm())
    assert model.gravity != arm().gravity
    drift = abs(float(np.linalg.norm(model.gravity)) - float(np.linalg.norm(arm().gravity)))
    assert drift <= 8 * np.finfo(float).eps * 9.81


def test_a_fixed_base_gets_a_rotated_root_and_a_floating_base_is_rotated() -> None:
    model, unchanged = rotate_world(arm())
    assert model.root == "rotated_world"
    assert model.joint_names == arm().joint_names
    q = arm().random(0)
    assert np.array_equal(unchanged(q), q)
    floating, rotate_base = rotate_world(arm("floating"))
    assert floating.root == arm().root
    assert not np.array_equal(rotate_base(arm("floating").neutral()), arm("floating").neutral())


def test_names_that_are_taken_are_avoided() -> None:
    twice, _ = rotate_world(rotate_world(arm())[0])
    assert twice.root == "rotated_world_"
