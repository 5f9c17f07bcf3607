"""Distances of the shapes of rigid bodies, height fields included, each prepared once for many poses."""

from __future__ import annotations

import math

import numpy as np

from dynx.distance.cores import Core, core_of
from dynx.distance.distance import Distance, distance_of_cores
from dynx.distance.height_fields import Field
from dynx.model.geometry import HeightField, Mesh, Plane, Shape
from dynx.spatial.scalar import Floats


class Solid:
    """A shape of a rigid body, prepared for distances, with a ball around it."""

    def __init__(self, shape: Shape, T: Floats) -> None:
        """`T` (4, 4) is the pose of the shape in the frame of its owner."""
        self.T = T
        self.field = Field(shape) if isinstance(shape, HeightField) else None
        self.core: Core | None = None
        self._center, self._reach = np.zeros(3), math.inf
        if not isinstance(shape, HeightField | Plane):
            self.core = core_of(shape)
            self._reach = self.core.extent + self.core.radius
        if isinstance(shape, Mesh):
            vertices = shape.hull[0]
            self._center = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
            self._reach = float(np.linalg.norm(vertices - self._center, axis=1).max())

    def place(self, T_world_owner: Floats) -> tuple[Solid, Floats, list[float]]:
        """Return the solid, its pose (4, 4), and the centre and radius of the ball around it."""
        T = T_world_owner @ self.T
        center: list[float] = (T[:3, :3] @ self._center + T[:3, 3]).tolist()
        return self, T, [*center, self._reach]


def distance_of_solids(a: Solid, T_a: Floats, b: Solid, T_b: Floats, limit: float) -> Distance | None:
    """Return the distance of two solids, None if it is larger than `limit` or not defined (two grounds)."""
    if a.core is None and b.core is None:
        return None
    if a.field is not None:
        assert b.core is not None
        found = a.field.distance(T_a, b.core, T_b, limit)
        return found and found.swapped()
    if b.field is not None:
        assert a.core is not None
        return b.field.distance(T_b, a.core, T_a, limit)
    return distance_of_cores(a.core, T_a, b.core, T_b, limit)
