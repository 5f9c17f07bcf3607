"""Poses of the rigid bodies that own colliders, from a state of the world."""

from __future__ import annotations

import numpy as np

from dynx.rbd.kinematics import Poses, body_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.steppers.layout import WORLD, Layout, Owner
from dynx.steppers.state import WorldState


class OwnerPoses:
    """Poses in the world of rigid bodies at one state; the kinematics of each robot is computed once."""

    def __init__(self, layout: Layout, state: WorldState) -> None:
        self._layout, self._state = layout, state
        self._robots: dict[int, Poses] = {}

    def __getitem__(self, owner: Owner) -> Floats:
        """Return the pose (4, 4) of a body."""
        robot, body = owner
        if robot is None:
            if body == WORLD:
                return np.eye(4)
            return self._state.bodies[self._layout.bodies[body].name].T_world_body
        if robot not in self._robots:
            layout = self._layout.robots[robot]
            mechanism = layout.model.mechanism
            q = self._state.robots[layout.name].q
            self._robots[robot] = body_poses(mechanism, mechanism.tree_q(q))
        return np.asarray(homogeneous(*self._robots[robot][body]), dtype=np.float64)


def owner_pose(layout: Layout, owner: Owner, state: WorldState) -> Floats:
    """Return the pose (4, 4) in the world of a rigid body."""
    return OwnerPoses(layout, state)[owner]
