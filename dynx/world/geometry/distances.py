"""Nearest points of colliders by `dynx.distance` from the poses of the world, the same on every engine."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from dynx.distance.cores import Core, core_of
from dynx.distance.distance import Distance, distance_of_cores
from dynx.model.geometry import HeightField, Mesh, Plane
from dynx.spatial.scalar import Floats
from dynx.world.geometry.height_field_distances import Field
from dynx.world.geometry.owner_poses import OwnerPoses
from dynx.world.layout import Layout, PlacedShape
from dynx.world.state import WorldState


class Solid:
    """A shape of a collider, prepared for distances, with a ball around it."""

    def __init__(self, placed: PlacedShape) -> None:
        shape = placed.shape
        self.T = placed.T
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


class Distances:
    """Distances of the colliders of one layout."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._solids: dict[int, list[Solid]] = {}

    def closest(
        self, state: WorldState, first: list[int], second: list[int], within: float
    ) -> Iterator[tuple[int, int, Distance]]:
        """Yield the distance of each pair of colliders that are at most `within` [m] apart.

        Of colliders with several shapes it is the pair of shapes with the least signed distance.
        """
        poses = OwnerPoses(self._layout, state)
        placed = {number: self._placed(number, poses) for number in {*first, *second}}
        for i in first:
            for j in second:
                if i == j:
                    continue
                best: Distance | None = None
                for solid_a, T_a, ball_a in placed[i]:
                    for solid_b, T_b, ball_b in placed[j]:
                        limit = within if best is None else best.distance
                        if math.dist(ball_a[:3], ball_b[:3]) - ball_a[3] - ball_b[3] > limit:
                            continue
                        found = _distance(solid_a, T_a, solid_b, T_b, limit)
                        if found is not None and found.distance <= limit:
                            best = found
                if best is not None:
                    yield i, j, best

    def _placed(self, number: int, poses: OwnerPoses) -> list[tuple[Solid, Floats, list[float]]]:
        """Return the solids of a collider, each with its pose and the ball around it."""
        collider = self._layout.colliders[number]
        if number not in self._solids:
            self._solids[number] = [Solid(placed) for placed in collider.shapes]
        pose = poses[collider.owner]
        return [solid.place(pose) for solid in self._solids[number]]


def _distance(a: Solid, T_a: Floats, b: Solid, T_b: Floats, limit: float) -> Distance | None:
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
