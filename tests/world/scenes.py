"""Scenes of the tests of worlds."""

from __future__ import annotations

import numpy as np

import dynx
from dynx import Model, Pose
from dynx.spatial.scalar import Floats
from dynx.world import PDMotor, Scene, SceneRobot, World, box, ground

GAINS = {"a1": (100.0, 2.0), "solo12": (10.0, 0.2)}
"""kp and kd with which each quadruped stands."""


def quadruped(name: str) -> tuple[Model, Floats]:
    """Return a quadruped, and a configuration in which it stands with its feet on the plane z = 0."""
    model = dynx.load(name, base="floating")
    q = np.zeros(model.nq)
    q[6], q[7:] = 1.0, np.tile([0.0, 0.8, -1.6], 4)
    with World(Scene("s", robots=(SceneRobot("dog", model, q=tuple(q)),))) as world:
        q[2] = -world.aabb("dog")[0][2]
    return model, q


def standing(name: str) -> tuple[Scene, PDMotor]:
    """Return a quadruped on a plane, and motors that hold its joints."""
    model, q = quadruped(name)
    scene = Scene("standing", robots=(SceneRobot("dog", model, q=tuple(q)),), bodies=(ground(),))
    return scene, PDMotor(q[7:], *GAINS[name])


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
