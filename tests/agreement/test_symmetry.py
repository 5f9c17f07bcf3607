from __future__ import annotations

import numpy as np

from dynx.agreement.identities import rotate_world
from dynx.model import Pose
from tests.agreement.robots import arm


def test_gravity_rotates_and_keeps_its_magnitude() -> None:
    model, _ = rotate_world(arm())
    assert model.gravity != arm().gravity
    drift = abs(float(np.linalg.norm(model.gravity)) - float(np.linalg.norm(arm().gravity)))
    assert drift <= 8 * np.finfo(float).eps * 9.81


def test_a_fixed_base_gets_a_rotated_pose_and_a_floating_base_is_rotated() -> None:
    model, unchanged = rotate_world(arm())
    assert model.root == arm().root
    R = model.base_pose.matrix[:3, :3]
    np.testing.assert_allclose(R @ arm().gravity, model.gravity, rtol=0, atol=1e-14)
    q = arm().random(0)
    assert np.array_equal(unchanged(q), q)
    floating, rotate_base = rotate_world(arm("floating"))
    assert floating.root == arm().root
    assert not np.array_equal(rotate_base(arm("floating").neutral()), arm("floating").neutral())


def test_a_pose_of_its_own_is_rotated_too() -> None:
    pose = Pose((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
    rotated = rotate_world(arm().with_base_pose(pose))[0].base_pose.matrix
    R = rotate_world(arm())[0].base_pose.matrix
    np.testing.assert_allclose(rotated, R @ pose.matrix, rtol=0, atol=1e-14)
