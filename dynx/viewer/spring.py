"""A spring from a handle in the page to a part of a world."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from dynx.rbd.link_poses import link_poses
from dynx.spatial.scalar import Floats
from dynx.world import World, Wrench

_FREQUENCY = 2.0 * math.pi * 1.0
"""Angular frequency [rad/s] at which a free body of the part's mass would swing on the spring."""


class Spring:
    """A critically damped spring between the handle and the origin of a part, while the handle is shown."""

    def __init__(self, scene: Any, size: float) -> None:
        self._node = scene.add_transform_controls(
            "/spring", scale=size, disable_rotations=True, depth_test=False, visible=False
        )
        self.part: str | None = None
        self._mass = 1.0
        self._before: Floats | None = None

    def hold(self, world: World, part: str | None) -> None:
        """Attach the handle to a part at its place, or remove it for None."""
        self.part, self._before = part, None
        self._node.visible = part is not None
        if part is not None:
            self._mass = _mass(world, part)
            self._node.position = _origin(world, part)

    def wrenches(self, world: World) -> list[Wrench]:
        """Return the force of the spring for the next step of `world.dt`."""
        if self.part is None:
            return []
        origin = _origin(world, self.part)
        before = origin if self._before is None else self._before
        velocity = (origin - before) / world.dt
        self._before = origin
        stretch = np.asarray(self._node.position, dtype=np.float64) - origin
        stiffness = self._mass * _FREQUENCY**2
        return [Wrench(self.part, stiffness * stretch - 2.0 * self._mass * _FREQUENCY * velocity)]


def _origin(world: World, part: str) -> Floats:
    robot, slash, link = part.partition("/")
    state = world.state
    if not slash:
        return state.bodies[part].position
    poses = dict(link_poses(world.scene.robot(robot).model, state.robots[robot].q))
    return np.asarray(poses[link][:3, 3])


def _mass(world: World, part: str) -> float:
    """Return the mass [kg] that the spring is made for: that of a body, or of the whole robot."""
    robot, slash, _ = part.partition("/")
    if slash:
        return world.scene.robot(robot).model.total_mass or 1.0
    return world.scene.body(part).mass or 1.0
