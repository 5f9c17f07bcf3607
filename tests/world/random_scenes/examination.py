"""Runs of one scene on one engine, and how far each law is from its bound."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dynx.model import Pose
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation, quat_product, rotation_from_rpy
from dynx.world import PointToPoint, Scene, SceneBody, SceneRobot, Weld, World, WorldState
from tests.world.random_scenes.laws import (
    energy_allowance,
    has_free_momentum,
    momentum_excess,
    reports_moments,
)
from tests.world.random_scenes.mechanics import rigid_bodies

STEPS = 150
"""Steps of a run, of the length `DT`."""
DT = 1e-3
"""Length of a step [s]."""

_IDENTITY = np.eye(4)

MOTION = Pose((0.4, -0.7, 0.2), (0.3, -0.4, 1.1))
"""The rigid motion by which scenes are moved."""


def examine(
    scene: Scene, engine: str, steps: int = STEPS, dt: float = DT, **settings: Any
) -> dict[str, float]:
    """Return the largest ratio of error and bound of each law that holds for the scene: above 1 it is
    violated."""
    worst = dict.fromkeys(("linear momentum", "angular momentum", "energy"), 0.0)
    free = has_free_momentum(scene) and not (engine == "mujoco" and _coupled(scene))
    moments = reports_moments(scene, engine)
    gravity, robots = np.array(scene.gravity), bool(scene.robots)
    with World(scene, engine, dt, **settings) as world:
        start = rigid_bodies(scene, world.state)
        energy = start.kinetic_energy + start.potential_energy(gravity)
        before, before_free, allowed = start, rigid_bodies(scene, world.state, free_only=True), 0.0
        for _ in range(round(steps * DT / dt)):
            world.step()
            state = world.state
            after, after_free = rigid_bodies(scene, state), rigid_bodies(scene, state, free_only=True)
            if free:
                excess = momentum_excess(scene, world, before_free, after_free, world.contacts())
                worst["linear momentum"] = max(worst["linear momentum"], excess.linear)
                if moments:
                    worst["angular momentum"] = max(worst["angular momentum"], excess.angular)
            allowed += energy_allowance(world, before, after, robots)
            gained = after.kinetic_energy + after.potential_energy(gravity) - energy
            worst["energy"] = max(worst["energy"], gained / allowed)
            before, before_free = after, after_free
    return worst


def final_state(scene: Scene, engine: str, steps: int = STEPS) -> WorldState:
    """Return the state after a run."""
    with World(scene, engine) as world:
        world.step(steps)
        return world.state


def numbers(state: WorldState) -> Floats:
    """Return all coordinates of a state, by the names of its parts."""
    parts = [state.robots[name] for name in sorted(state.robots)]
    parts += [state.bodies[name] for name in sorted(state.bodies)]  # type: ignore[misc]
    return np.concatenate([np.zeros(0), *(np.ravel(x) for each in parts for x in each)])


def permuted(scene: Scene) -> Scene:
    """Return the scene with its robots and its bodies in the opposite order."""
    return replace(scene, robots=scene.robots[::-1], bodies=scene.bodies[::-1])


def moved(scene: Scene) -> Scene:
    """Return the scene, gravity included, moved by `MOTION`."""
    T = MOTION.matrix
    return replace(
        scene,
        robots=tuple(_moved_robot(each, T) for each in scene.robots),
        bodies=tuple(_moved_body(each, T) for each in scene.bodies),
        constraints=tuple(_moved_constraint(each, T) for each in scene.constraints),
        gravity=tuple((T[:3, :3] @ np.array(scene.gravity)).tolist()),
    )


def distance(original: WorldState, other: WorldState, T: Floats = _IDENTITY) -> float:
    """Return the largest distance [m] between the bodies of a state, moved by T, and those of another."""
    gaps = [
        np.linalg.norm((T @ body.T_world_body)[:3, 3] - other.bodies[name].T_world_body[:3, 3])
        for name, body in original.bodies.items()
    ]
    return float(max(gaps, default=0.0))


def _coupled(scene: Scene) -> bool:
    """Check whether a robot has mimic joints, which MuJoCo couples softly; the state has the drivers only."""
    return any(robot.model.mechanism.coupling is not None for robot in scene.robots)


def _moved_robot(robot: SceneRobot, T: Floats) -> SceneRobot:
    if not robot.model.floating:
        pose = Pose.from_matrix(T @ robot.model.base_pose.matrix)
        return replace(robot, model=robot.model.with_base_pose(pose))
    q = np.array(robot.q)
    q[:3] = T[:3, :3] @ q[:3] + T[:3, 3]
    q[3:7] = quat_product(quat_from_rotation(rotation_from_rpy(np.array(MOTION.rpy))), q[3:7])
    return replace(robot, q=tuple(q.tolist()))


def _moved_body(body: SceneBody, T: Floats) -> SceneBody:
    R, twist = T[:3, :3], np.array(body.twist)
    return replace(
        body,
        pose=Pose.from_matrix(T @ body.pose.matrix),
        twist=(*(R @ twist[:3]).tolist(), *(R @ twist[3:]).tolist()),
    )


def _moved_constraint(constraint: Weld | PointToPoint, T: Floats) -> Weld | PointToPoint:
    """Move the end in the world of a ball joint; a weld holds what is there at the start."""
    if isinstance(constraint, PointToPoint) and constraint.b == "world":
        x, y, z = (T[:3, :3] @ np.array(constraint.point_b) + T[:3, 3]).tolist()
        return replace(constraint, point_b=(x, y, z))
    return constraint
