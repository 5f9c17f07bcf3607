"""Robots with their collision meshes on the ground of every engine: a sample of those that are installed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dynx
from dynx.backends import backend
from dynx.model.tree import Base
from dynx.spatial.scalar import Floats
from dynx.world import Scene, SceneRobot, World, ground
from dynx.world.boxes import shape_box
from tests.world.engines import WORLDS


def on_the_ground(robot: str, base: Base) -> Scene:
    """Return a robot above the ground: a floating one falls from 1 m, a fixed one hangs 1 mm above it."""
    model = dynx.load(robot, base=base)
    q = model.clip(model.neutral())
    floor = ground()
    if base == "floating":
        q[2] = 1.0
    else:
        floor = replace(floor, pose=dynx.Pose((0.0, 0.0, lowest(model, q) - 1e-3)))
    return Scene("ground", robots=(SceneRobot("robot", model, q=tuple(q)),), bodies=(floor,))


def lowest(model: dynx.Model, q: Floats) -> float:
    """Return the height [m] of the lowest point of the collision shapes of a fixed robot, or 0."""
    with backend("reference", model) as engine:
        boxes = [
            shape_box(each.shape, engine.forward_kinematics(q, link.name) @ each.origin.matrix)
            for link in model.links
            for each in model.geometry.collisions(link.name)
        ]
    return float(min((lower[2] for lower, _ in boxes), default=0.0))


@pytest.mark.parametrize("engine", WORLDS)
@pytest.mark.parametrize(("robot", "base"), [("ur5_gripper", "fixed"), ("hyq", "floating")])
def test_robots_with_their_meshes_step_in_every_engine(engine: str, robot: str, base: Base) -> None:
    with World(on_the_ground(robot, base), engine) as world:
        world.step(200)
        assert np.isfinite(world.state.robots["robot"].q).all()
        assert world.time == pytest.approx(0.2)
