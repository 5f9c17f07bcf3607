"""Scenes of the tests of worlds."""

from __future__ import annotations

import dynx
from dynx import Pose
from dynx.world import Scene, SceneRobot, box, ground
from tests.world.standing import quadruped


def crowd() -> Scene:
    """Return an arm, a quadruped and a stack of boxes, which touch the ground or soon will."""
    dog, q = quadruped("a1")
    arm = dynx.load("ur5").with_base_pose(Pose((3.0, 0.0, 0.0)))
    boxes = tuple(
        box(f"box{k}", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((-1.1, 0.003 * k, 0.05 + 0.1001 * k)))
        for k in range(3)
    )
    robots = (SceneRobot("dog", dog, q=tuple(q)), SceneRobot("arm", arm))
    return Scene("crowd", robots=robots, bodies=(ground(), *boxes))
