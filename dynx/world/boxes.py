"""Poses of the rigid bodies that own colliders, and boxes along the axes of the world around their shapes."""

from __future__ import annotations

import numpy as np

from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, HeightField, Mesh, Plane, Shape, Sphere
from dynx.rbd.kinematics import Poses, body_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.steppers.layout import WORLD, Collider, Layout, Owner
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


Corners = tuple[Floats, Floats]


def collider_box(layout: Layout, collider: Collider, state: WorldState) -> Corners:
    """Return the lower and the upper corner (3,) of the box around the shapes of a collider."""
    T_world_owner = owner_pose(layout, collider.owner, state)
    corners = [shape_box(each.shape, T_world_owner @ each.T) for each in collider.shapes]
    return np.min([c[0] for c in corners], axis=0), np.max([c[1] for c in corners], axis=0)


def shape_box(shape: Shape, T: Floats) -> Corners:
    """Return the lower and the upper corner (3,) of the box around a shape at the pose T (4, 4)."""
    R, p = T[:3, :3], T[:3, 3]
    if isinstance(shape, Plane):
        return _half_space(R[:, 2], p)
    if isinstance(shape, Mesh | HeightField):
        points = (shape.hull if isinstance(shape, Mesh) else shape.triangles())[0] @ R.T + p
        return points.min(axis=0), points.max(axis=0)
    if isinstance(shape, Box):
        reach = np.abs(R) @ np.array(shape.size) / 2
    elif isinstance(shape, Sphere):
        reach = np.full(3, shape.radius)
    elif isinstance(shape, Capsule):
        reach = shape.radius + np.abs(R[:, 2]) * shape.length / 2
    elif isinstance(shape, Ellipsoid):
        reach = np.linalg.norm(R * np.array(shape.radii), axis=1)
    else:
        assert isinstance(shape, Cylinder)
        across = np.hypot(R[:, 0], R[:, 1])
        reach = np.abs(R[:, 2]) * shape.length / 2 + shape.radius * across
    return p - reach, p + reach


def _half_space(normal: Floats, p: Floats) -> Corners:
    """Return the box around the points below a plane: it ends only along a normal that is an axis."""
    lower, upper = np.full(3, -np.inf), np.full(3, np.inf)
    axis = int(np.argmax(np.abs(normal)))
    if np.count_nonzero(np.abs(normal) > 1e-12) == 1:
        (upper if normal[axis] > 0.0 else lower)[axis] = p[axis]
    return lower, upper
