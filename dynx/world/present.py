"""The scene of a world as it stands at a state."""

from __future__ import annotations

from dataclasses import replace

from dynx.model import Pose
from dynx.steppers.state import WorldState
from dynx.world.scene import Scene


def scene_at(scene: Scene, state: WorldState) -> Scene:
    """Return the scene with its robots and bodies where they are at a state, at rest."""
    robots = [replace(robot, q=tuple(state.robots[robot.name].q.tolist()), v=None) for robot in scene.robots]
    bodies = [
        body
        if body.fixed
        else replace(body, pose=Pose.from_matrix(state.bodies[body.name].T_world_body), twist=(0.0,) * 6)
        for body in scene.bodies
    ]
    return replace(scene, robots=tuple(robots), bodies=tuple(bodies))
