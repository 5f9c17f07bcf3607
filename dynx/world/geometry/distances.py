"""Nearest points of colliders by `dynx.distance` from the poses of the world, the same on every engine."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from dynx.distance.cores import Core, core_of
from dynx.distance.distance import Distance, distance_of
from dynx.model.geometry import HeightField, Mesh, Plane
from dynx.rbd.kinematics import body_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.world.geometry.height_field_distances import Field
from dynx.world.layout import WORLD, Layout, Owner, PlacedShape
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

    def at(self, T_world_owner: Floats) -> tuple[Solid, Floats, list[float]]:
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
        poses = _Poses(self._layout, state)
        placed = {
            number: [solid.at(poses[self._layout.colliders[number].owner]) for solid in self._of(number)]
            for number in {*first, *second}
        }
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

    def _of(self, number: int) -> list[Solid]:
        if number not in self._solids:
            self._solids[number] = [Solid(placed) for placed in self._layout.colliders[number].shapes]
        return self._solids[number]


class _Poses(dict[Owner, Floats]):
    """Poses (4, 4) of the owners of colliders, each robot's computed once."""

    def __init__(self, layout: Layout, state: WorldState) -> None:
        super().__init__()
        self._layout, self._state = layout, state

    def __missing__(self, owner: Owner) -> Floats:
        layout, state = self._layout, self._state
        if owner.robot is None:
            body = owner.body
            self[owner] = np.eye(4) if body == WORLD else state.bodies[layout.bodies[body].name].T_world_body
            return self[owner]
        model = layout.robots[owner.robot].model
        q, mechanism = state.robots[layout.robots[owner.robot].name].q, model.mechanism
        poses = body_poses(mechanism, q if mechanism.coupling is None else mechanism.coupling.expand_q(q))
        for collider in layout.colliders:
            if collider.owner.robot == owner.robot:
                self[collider.owner] = np.asarray(homogeneous(*poses[collider.owner.body]), dtype=np.float64)
        return self[owner]


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
    return distance_of(a.core, T_a, b.core, T_b, limit)
