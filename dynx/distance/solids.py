"""Distances of the shapes of rigid bodies, height fields included, each prepared once for many poses.

The distance from a height field is that from the prism below each triangle that may be nearest.
"""

from __future__ import annotations

import math

import numpy as np

from dynx.distance.cores import Core, Hull, HullCore, core_of
from dynx.distance.distance import Distance, distance_of_cores
from dynx.distance.terrain import Terrain
from dynx.model.geometry import HeightField, Mesh, Plane, Shape
from dynx.spatial.scalar import Floats


class Field:
    """The triangles of a height field, each the top of a prism."""

    def __init__(self, shape: HeightField) -> None:
        self.terrain = Terrain(shape)
        vertices, faces = shape.triangles()
        self._tops: Floats = vertices[faces]
        normals = np.cross(self._tops[:, 1] - self._tops[:, 0], self._tops[:, 2] - self._tops[:, 0])
        self._normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self._bottom = float(vertices[:, 2].min()) - shape.DEPTH
        self._lower, self._upper = self._tops.min(axis=1), self._tops.max(axis=1)
        self._lower[:, 2] = self._bottom

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Lower and upper corner (3,) of the solid in its own frame [m]."""
        return self._lower.min(axis=0), self._upper.max(axis=0)

    def distance(self, T_field: Floats, core: Core, T: Floats, limit: float) -> Distance | None:
        """Return the distance of a shape, first, from the nearest prism; None if it is above `limit`."""
        R = T_field[:3, :3]
        near: Floats = np.eye(4)
        near[:3, :3], near[:3, 3] = R.T @ T[:3, :3], R.T @ (T[:3, 3] - T_field[:3, 3])
        bounds = self._lower_bounds(core, near)
        best: Distance | None = None
        candidates = np.flatnonzero(bounds <= limit)
        for number in candidates[np.argsort(bounds[candidates])].tolist():
            if bounds[number] >= limit:
                break
            found = distance_of_cores(core, near, HullCore(self._prism(number)), np.eye(4), limit)
            if found is not None and found.distance <= limit:
                best, limit = found, found.distance
        if best is None:
            return None
        point_a, point_b = R @ best.point_a + T_field[:3, 3], R @ best.point_b + T_field[:3, 3]
        return Distance(best.lower, best.upper, point_a, point_b, R @ best.normal)

    def _lower_bounds(self, core: Core, T: Floats) -> Floats:
        """Return lower bounds of the signed distance from each prism: separations along some normals."""
        core.place(T[:3, :3], (0.0, 0.0, 0.0))
        p = T[:3, 3]
        highest = np.einsum("ij,ij->i", core.supports(np.eye(3)), np.eye(3)) + core.radius + p
        lowest = -np.einsum("ij,ij->i", core.supports(-np.eye(3)), -np.eye(3)) - core.radius + p
        bounds = np.maximum(lowest - self._upper, self._lower - highest).max(axis=1)
        # The planes of the triangles are closer, and worth their time where the boxes overlap.
        near = np.flatnonzero(bounds <= 0.0)
        if not len(near):
            return np.asarray(bounds)
        normals = self._normals[near]
        deepest = core.supports(-normals) - core.radius * normals + p
        heights = np.einsum("ij,ij->i", normals, deepest - self._tops[near, 0])
        bounds[near] = np.maximum(bounds[near], heights)
        return np.asarray(bounds)

    def _prism(self, number: int) -> Floats:
        bottom = self._tops[number].copy()
        bottom[:, 2] = self._bottom
        return np.concatenate([self._tops[number], bottom])


class Solid:
    """A shape of a rigid body, prepared for distances, with a ball around it."""

    def __init__(self, shape: Shape | Hull, T: Floats) -> None:
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
