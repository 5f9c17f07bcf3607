"""Nearest points of shapes in Drake; in closed form those of a half-space, which Drake has for balls only."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.model.geometry import Box, Capsule, Cylinder, Mesh, Shape, Sphere
from dynx.spatial.scalar import Floats
from dynx.world.engine import TouchingPoint


def closest_of_pair(query: Any, a: Any, b: Any) -> tuple[Floats, Floats, Floats, float]:
    """Return the nearest points of two geometries of Drake, the normal from b to a, and the distance."""
    found = query.ComputeSignedDistancePairClosestPoints(a, b)
    point_a = query.GetPoseInWorld(found.id_A).multiply(found.p_ACa)
    point_b = query.GetPoseInWorld(found.id_B).multiply(found.p_BCb)
    normal = np.array(found.nhat_BA_W)
    if found.id_A != a:
        point_a, point_b, normal = point_b, point_a, -normal
    return np.array(point_a), np.array(point_b), normal, float(found.distance)


def closest_to_plane(numbers: tuple[int, int], T_plane: Floats, shape: Shape, T: Floats) -> TouchingPoint:
    """Return the nearest points of a half-space, first of `numbers`, and of a bounded shape at T (4, 4)."""
    up = T_plane[:3, 2]
    deepest = T[:3, 3] + T[:3, :3] @ support(shape, -up @ T[:3, :3])
    height = float(up @ (deepest - T_plane[:3, 3]))
    return TouchingPoint(*numbers, deepest - height * up, deepest, -up, height)


def support(shape: Shape, direction: Floats) -> Floats:
    """Return a point (3,) of a bounded shape that is farthest along a unit direction, in its own axes."""
    if isinstance(shape, Mesh):
        vertices = shape.hull[0]
        return np.array(vertices[np.argmax(vertices @ direction)])
    if isinstance(shape, Box):
        return 0.5 * np.array(shape.size) * np.sign(direction)
    if isinstance(shape, Sphere):
        return shape.radius * direction
    assert isinstance(shape, Capsule | Cylinder)
    end = np.array([0.0, 0.0, 0.5 * shape.length * np.sign(direction[2])])
    if isinstance(shape, Capsule):
        return end + shape.radius * direction
    across = np.array([direction[0], direction[1], 0.0])
    length = float(np.linalg.norm(across))
    return end + shape.radius * across / length if length > 0.0 else end
